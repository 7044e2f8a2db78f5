(() => {
  const { signals, runs } = JSON.parse(document.getElementById("curves-data").textContent);
  const card = document.getElementById("plot"), plot = card.querySelector(".curves");
  const chosen = card.querySelector("select"), whole = card.querySelector("button"), output = card.querySelector("output");
  const boxes = [...card.querySelectorAll(".key input")], values = [...card.querySelectorAll(".key small")];
  const LEFT = 62, RIGHT = 12, TOP = 10, BASE = 24, NEAR = 6; // pixels
  const START = Math.min(...runs.map((run) => run.start)), END = Math.max(...runs.map((run) => run.end));
  let from = START, to = END, width = 0, height = 0, low = 0, high = 1, pressed = null, now = null, cursor, picked;

  const decoded = new Map();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  // A run's chosen signal as times and numbers, decoded when it is first looked at.
  const curve = (run) => {
    const coded = run.curves[chosen.selectedIndex];
    if (!decoded.has(coded)) {
      const view = new DataView(bytes(coded.numbers).buffer), places = bytes(coded.places), count = view.byteLength / 4;
      const part = (i) => (places.length ? ((i >> 1) + places[i] / 256) / (count / 2) : i / Math.max(1, count - 1));
      decoded.set(coded, Array.from({ length: count }, (_, i) => ({ t: run.start + (run.end - run.start) * part(i), y: view.getFloat32(4 * i, true) })));
    }
    return decoded.get(coded);
  };
  // The number nearest to a time; NaN beyond the run.
  const value = (run, t) => {
    if (t < run.start || t > run.end) return NaN;
    return curve(run).reduce((best, one) => (Math.abs(one.t - t) < Math.abs(best.t - t) ? one : best)).y;
  };
  const across = (t) => LEFT + (width - LEFT - RIGHT) * (t - from) / (to - from);
  const back = (x) => Math.min(to, Math.max(from, from + (to - from) * (x - LEFT) / (width - LEFT - RIGHT)));
  const up = (y) => TOP + (height - TOP - BASE) * (high - y) / (high - low);
  const inView = () => runs.filter((_, place) => boxes[place].checked);
  const ticks = (first, last, count) => {
    const step = round((last - first) / count), found = [];
    for (let i = Math.ceil(first / step - 1e-9); i * step <= last * (1 + 1e-12) + 1e-12 && found.length < 50; i++) found.push(+(i * step).toPrecision(9));
    return found;
  };

  const fit = () => {
    [low, high] = [Infinity, -Infinity];
    for (const run of inView()) curve(run).forEach(({ t, y }) => {
      if (t >= from && t <= to && !Number.isNaN(y)) [low, high] = [Math.min(low, y), Math.max(high, y)];
    });
    if (low > high) [low, high] = [0, 1];
    const room = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
    [low, high] = [low - room, high + room];
  };
  const draw = () => {
    width = Math.max(200, plot.clientWidth);
    height = Math.round(Math.min(360, Math.max(220, 0.4 * width)));
    set(plot, "viewBox", `0 0 ${width} ${height}`);
    plot.replaceChildren();
    fit();
    for (const y of ticks(low, high, 5)) {
      make(plot, "path", { d: `M${LEFT} ${up(y)}H${width - RIGHT}`, class: "rule" });
      make(plot, "text", { x: LEFT - 6, y: up(y) + 4, "text-anchor": "end" }, `${+y.toPrecision(6)}`);
    }
    for (const t of ticks(from, to, Math.max(2, width / 110))) make(plot, "text", { x: across(t), y: height - 6, "text-anchor": "middle" }, `${t} s`);
    const clip = make(make(plot, "clipPath", { id: "plotted" }), "rect", { x: LEFT, y: TOP, width: width - LEFT - RIGHT, height: height - TOP - BASE });
    const inside = make(plot, "g", { "clip-path": "url(#plotted)", fill: "none" });
    for (const run of inView()) {
      let pen = "M", d = "";
      curve(run).forEach(({ t, y }) => {
        if (Number.isNaN(y)) { pen = "M"; return; }
        d += `${pen}${across(t).toFixed(1)} ${up(y).toFixed(1)}`;
        pen = "L";
      });
      make(inside, "path", { ...line(run, 1.4), d });
    }
    picked = make(inside, "rect", { y: TOP, height: height - TOP - BASE, class: "picked" });
    cursor = make(inside, "path", { class: "cursor" });
    whole.disabled = from === START && to === END;
    point(now);
  };
  // Show the values at a time beside the names of the runs; null for none.
  const point = (t) => {
    now = t;
    set(cursor, "d", t === null ? "" : `M${across(t)} ${TOP}V${height - BASE}`);
    output.textContent = t === null ? "" : `t = ${t.toFixed(END < 20 ? 3 : 1)} s`;
    runs.forEach((run, place) => {
      const y = t === null ? NaN : value(run, t);
      values[place].textContent = Number.isNaN(y) ? "" : `${+y.toPrecision(4)} ${signals[chosen.selectedIndex].unit}`;
    });
  };
  const zoom = (first, last) => { [from, to] = [Math.max(START, first), Math.min(END, last)]; draw(); };
  const at = (event) => event.clientX - plot.getBoundingClientRect().left;

  plot.addEventListener("pointerdown", (event) => { pressed = at(event); plot.setPointerCapture(event.pointerId); point(back(pressed)); });
  plot.addEventListener("pointermove", (event) => {
    const x = at(event);
    if (pressed !== null) { set(picked, "x", Math.min(x, pressed)); set(picked, "width", Math.abs(x - pressed)); }
    point(back(x));
  });
  plot.addEventListener("pointerup", (event) => {
    const [first, last] = [pressed, at(event)].sort((a, b) => a - b);
    pressed = null;
    if (last - first > NEAR && back(last) > back(first)) zoom(back(first), back(last)); else set(picked, "width", 0);
  });
  plot.addEventListener("pointercancel", () => { pressed = null; set(picked, "width", 0); });
  plot.addEventListener("pointerleave", () => { if (pressed === null) point(null); });
  plot.addEventListener("dblclick", () => zoom(START, END));
  card.addEventListener("keydown", (event) => {
    if (event.target !== card) return;
    const middle = now ?? (from + to) / 2, half = (to - from) / 2, step = (to - from) / 100;
    if (event.key === "ArrowLeft") point(Math.max(from, middle - step));
    else if (event.key === "ArrowRight") point(Math.min(to, middle + step));
    else if (event.key === "+") zoom(middle - half / 2, middle + half / 2);
    else if (event.key === "-") zoom(middle - 2 * half, middle + 2 * half);
    else if (event.key === "Escape") zoom(START, END);
    else return;
    event.preventDefault();
  });
  whole.addEventListener("click", () => zoom(START, END));
  chosen.addEventListener("change", draw);
  for (const box of boxes) box.addEventListener("change", draw);
  addEventListener("resize", draw);
  draw();
})();
