// Panels of curves over time; what it returns shows signals of runs, and again other ones.
const curvesOn = (card) => {
  let signals = [], runs = [], choice = [], boxes = [], values = [], START = 0, END = 0, held = null;
  const plot = card.querySelector(".curves"), output = card.querySelector("output");
  const [whole, log] = [card.querySelector("button"), card.querySelector("input.log")];
  const LEFT = 72, RIGHT = 14, TOP = 20, BASE = 26, LOW = 110, NEAR = 6; // pixels
  const PAPER = 720; // pixels, the width on a printed page
  let from = 0, to = 0, width = 0, height = 0, panels = [], pressed = null, now = null, cursor, picked;

  const decoded = new Map();
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  // A signal of a run as times and numbers, decoded when it is first looked at.
  const curve = (run, place) => {
    const coded = run.curves[place];
    if (!coded) return [];
    if (!decoded.has(coded)) {
      const view = new DataView(bytes(coded.numbers).buffer), places = bytes(coded.places), count = view.byteLength / 4;
      const part = (i) => (places.length ? ((i >> 1) + places[i] / 256) / (count / 2) : i / Math.max(1, count - 1));
      decoded.set(coded, Array.from({ length: count }, (_, i) => ({ t: run.start + (run.end - run.start) * part(i), y: view.getFloat32(4 * i, true) })));
    }
    return decoded.get(coded);
  };
  // The number nearest to a time; NaN beyond the run.
  const value = (run, place, t) => {
    const points = t < run.start || t > run.end ? [] : curve(run, place);
    return points.reduce((best, one) => (Math.abs(one.t - t) < Math.abs(best.t - t) ? one : best), { t: Infinity, y: NaN }).y;
  };
  // A place on an axis that is linear up to a size and logarithmic beyond, and the number at a place.
  const warped = ({ linear, floor }, y) => {
    const size = Math.max(Math.abs(y), floor ? linear : 0) / linear;
    return (floor || y >= 0 ? 1 : -1) * (size < 1 ? size : 1 + Math.log10(size));
  };
  const number = ({ linear }, w) => Math.sign(w) * linear * (Math.abs(w) < 1 ? Math.abs(w) : 10 ** (Math.abs(w) - 1));
  const bent = (signal) => signal.linear && log.checked;
  const on = (signal, y) => (bent(signal) ? warped(signal, y) : y);

  const across = (t) => LEFT + (width - LEFT - RIGHT) * (t - from) / (to - from);
  const back = (x) => Math.min(to, Math.max(from, from + (to - from) * (x - LEFT) / (width - LEFT - RIGHT)));
  const up = ({ signal, top, tall, low, high }, y) => top + tall * (high - on(signal, y)) / (high - low);
  const inView = () => runs.filter((_, place) => boxes[place].checked);
  const ticks = (first, last, count) => {
    const step = round((last - first) / count), found = [];
    for (let i = Math.ceil(first / step - 1e-9); i * step <= last * (1 + 1e-12) + 1e-12 && found.length < 50; i++) found.push(+(i * step).toPrecision(9));
    return found;
  };
  // The numbers at an axis: some decades and 0, or evenly spaced ones where there are not two of these.
  const marks = ({ signal, tall, low, high }) => {
    if (!bent(signal)) return ticks(low, high, tall / 30);
    const stride = Math.ceil((high - low) / (tall / 18)), found = signal.floor ? [] : [0];
    for (let power = Math.ceil(Math.log10(signal.linear) - 1e-9), i = 0; i < 60; i++, power += stride) found.push(10 ** power, -(10 ** power));
    const seen = found.filter((y) => on(signal, y) >= low && on(signal, y) <= high && !(signal.floor && y < 0));
    return seen.length > 1 ? seen : ticks(number(signal, low), number(signal, high), tall / 30);
  };
  // A panel's signal and limits; runs that did not finish set these only where no other is in view.
  const panel = (place, row, tall) => {
    const signal = signals[place], having = inView().filter((run) => run.curves[place]), ended = having.filter((run) => run.whole);
    let [low, high] = [Infinity, -Infinity];
    for (const run of ended.length ? ended : having) curve(run, place).forEach(({ t, y }) => {
      if (t >= from && t <= Math.min(to, from < run.counts ? run.counts : to) && !Number.isNaN(y)) [low, high] = [Math.min(low, on(signal, y)), Math.max(high, on(signal, y))];
    });
    if (low > high) [low, high] = [0, 1];
    if (held) { // while values move, axes only grow, so that curves can be compared
      const last = held[signal.name] ?? [low, high];
      [low, high] = held[signal.name] = [Math.min(low, last[0]), Math.max(high, last[1])];
    }
    const room = 0.05 * (high - low) || 0.05 * Math.abs(high) || 1;
    return { place, signal, tall, ends: [low, high], top: TOP + row * (tall + TOP), low: low - room, high: high + room };
  };
  // Text with what stands below the line in it, in turns.
  const formula = (text, pieces) => pieces.forEach(([plain, below]) => {
    make(text, "tspan", {}, plain);
    if (below) { make(text, "tspan", { dy: 3, "font-size": "8px" }, below); make(text, "tspan", { dy: -3 }, "\u200b"); }
  });
  const drawPanel = (one, times) => {
    const { place, signal, top, tall } = one, middle = top + tall / 2;
    for (const t of times) make(plot, "path", { d: `M${across(t)} ${top}v${tall}`, class: "rule" });
    for (const y of marks(one)) {
      make(plot, "path", { d: `M${LEFT} ${up(one, y)}H${width - RIGHT}`, class: "rule" });
      make(plot, "text", { x: LEFT - 6, y: up(one, y) + 4, "text-anchor": "end" }, `${+y.toPrecision(6)}`);
    }
    const title = make(plot, "text", { x: LEFT, y: top - 6, class: "title" }, signal.meaning);
    for (const shorter of [signal.meaning.split(/[:,(]| that /)[0], signal.name]) // where the window is narrow
      if (title.getComputedTextLength() > width - LEFT) title.textContent = shorter;
    formula(make(plot, "text", { transform: `rotate(-90 12 ${middle})`, x: 12, y: middle, "text-anchor": "middle", class: "label" }), [...signal.symbol, [` [${signal.unit}]`, ""]]);
    const clip = make(make(plot, "clipPath", { id: `plotted-${place}` }), "rect", { x: LEFT, y: top, width: width - LEFT - RIGHT, height: tall });
    const inside = make(plot, "g", { "clip-path": `url(#plotted-${place})`, fill: "none" });
    for (const run of inView()) {
      const path = (points) => {
        let pen = "M", d = "";
        points.forEach(({ t, y }) => {
          if (Number.isNaN(y)) { pen = "M"; return; }
          d += `${pen}${across(t).toFixed(1)} ${up(one, y).toFixed(1)}`;
          pen = "L";
        });
        return d;
      };
      const points = curve(run, place), last = points.findIndex(({ t }) => t > run.counts); // the end of its path
      if (last > 0) make(inside, "path", { ...line(run, 1.4), d: path(points.slice(last - 1)), class: "after" });
      make(inside, "path", { ...line(run, 1.4), d: path(last < 0 ? points : points.slice(0, last)), opacity: run.kept ? 0.35 : 1 });
    }
  };
  const draw = (wide = plot.clientWidth) => {
    const chosen = signals.map((_, place) => place).filter((place) => !choice.length || choice[place].checked);
    width = Math.max(200, wide);
    const tall = chosen.length > 1 ? LOW : Math.round(Math.min(330, Math.max(190, 0.4 * width)));
    height = TOP + chosen.length * (tall + TOP) - TOP + BASE;
    set(plot, "viewBox", `0 0 ${width} ${height}`);
    plot.replaceChildren();
    panels = chosen.map((place, row) => panel(place, row, tall));
    const times = ticks(from, to, Math.max(2, width / 110));
    for (const one of panels) drawPanel(one, times);
    for (const t of times) make(plot, "text", { x: across(t), y: height - 8, "text-anchor": "middle" }, `${t} s`);
    picked = make(plot, "rect", { y: TOP, height: height - TOP - BASE, class: "picked" });
    cursor = make(plot, "path", { class: "cursor" });
    whole.disabled = from === START && to === END;
    point(now);
  };
  // Show the values at a time beside the names of the runs; null for none.
  const point = (t) => {
    now = t;
    set(cursor, "d", t === null ? "" : `M${across(t)} ${TOP}V${height - BASE}`);
    output.textContent = t === null ? "" : `t = ${t.toFixed(END < 20 ? 3 : 1)} s`;
    const shown = (run) => panels.map(({ place, signal }) => [signal, t === null ? NaN : value(run, place, t)]).filter(([, y]) => !Number.isNaN(y));
    runs.forEach((run, row) => { values[row].textContent = shown(run).map(([{ name, unit }, y]) => `${name} ${+y.toPrecision(4)} ${unit}`).join(", "); });
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
  card.addEventListener("change", () => draw());
  addEventListener("resize", () => draw());
  addEventListener("beforeprint", () => draw(PAPER));
  addEventListener("afterprint", () => draw());
  return {
    // With `hold`, axes only grow from those before.
    show(data, hold = false) {
      const whole = from === START && to === END;
      ({ signals, runs } = data);
      choice = [...card.querySelectorAll(".choice input")];
      boxes = [...card.querySelectorAll(".key input")];
      values = [...card.querySelectorAll(".key small")];
      START = Math.min(...runs.map((run) => run.start));
      END = Math.max(...runs.map((run) => run.end));
      if (whole) [from, to] = [START, END];
      held = hold ? held ?? Object.fromEntries(panels.map(({ signal, ends }) => [signal.name, ends])) : null;
      decoded.clear();
      draw();
    },
  };
};
if (document.getElementById("curves-data")) {
  curvesOn(document.getElementById("plot")).show(JSON.parse(document.getElementById("curves-data").textContent));
}
