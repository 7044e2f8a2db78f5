// The map with a trace below it or beside it; what it returns shows runs, and again other ones.
const chaseOn = (stage) => {
  let box, end = 0, runs = [], traced = [], low = 0, high = 0;
  const one = (selector) => stage.querySelector(selector);
  const map = one(".map"), trace = one(".trace"), slider = one("input[type=range]"), output = one("output");
  const button = one(".play"), speed = one("select"), near = one("input[type=checkbox]");
  const HULL = [[0.5, 0], [0.25, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.25, -0.5]];
  const LEAST = 22; // pixels of a hull's length
  const LEAST_MAP = 120, REST = 340, BELOW = 200; // pixels of the map's sides; width of what may stand beside it, and height below its trace
  const LOW = 1e-3, LEFT = 54, RIGHT = 20, TOP = 8, BASE = 20, LOWEST = 130; // the trace: metres, pixels
  let now = 0, playing = false, last = 0, width = 0, height = 0, wide = 0, tall = LOWEST; // wide, tall: the trace

  // The last frame that is not after the time.
  const row = (run, t) => {
    let low = 0, high = run.time.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (run.time[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
  };
  const turn = (a) => Math.atan2(Math.sin(a), Math.cos(a));
  // Where a run is at a time; between two frames on the straight line.
  const at = (run, t) => {
    const i = row(run, t), j = Math.min(i + 1, run.time.length - 1);
    const part = j > i ? Math.min(1, (t - run.time[i]) / (run.time[j] - run.time[i])) : 0;
    const mix = (name) => run[name][i] + part * (run[name][j] - run[name][i]);
    const [north, east] = run.x_d ? [mix("x_d"), mix("y_d")] : [mix("x"), mix("y")];
    return { i, x: mix("x"), y: mix("y"), psi: run.psi[i] + part * turn(run.psi[j] - run.psi[i]), north, east };
  };

  const points = (north, east) => north.map((x, i) => (x === null || east[i] === null ? "" : `${east[i]},${x}`));
  const world = make(map, "g", { class: "world" }), over = make(map, "g");
  const lay = () => {
    for (const group of [world, over]) group.replaceChildren();
    for (const run of runs) {
    run.points = points(run.x, run.y);
    const course = run.x_d ? [run.x_d, run.y_d] : run.legs;
    if (course.length) make(world, "polyline", { points: points(...course).join(" "), class: "course", "stroke-width": 0.8 });
    make(world, "polyline", { points: run.points.join(" "), stroke: run.color, "stroke-width": 1.2, class: "ghost" });
    run.after = make(world, "polyline", { ...line(run, 2), class: "after" }); // the end of its path
    run.trail = make(world, "polyline", line(run, 2));
    if (run.kept) run.trail.classList.add("lost");
    }
    for (const run of runs) {
    run.ring = make(over, "circle", { class: "ring" });
    run.cross = make(over, "path", { d: "M-5 0H5M0 -5V5", class: "cross", "stroke-width": 1.6 });
    run.hull = make(over, "polygon", { fill: run.color, "fill-opacity": 0.55, stroke: run.color });
    run.stern = make(over, "line", { class: "stern", "stroke-width": 1.5 });
    }
    traced = runs.filter((run) => run.distance.length);
    const settled = traced.filter((run) => !run.ending);
    const tops = (settled.length ? settled : traced).flatMap((run) => run.distance).filter((z) => z !== null);
    high = Math.ceil(Math.log10(Math.max(10 * LOW, tops.reduce((a, b) => Math.max(a, b), 0))));
    low = Math.max(Math.log10(LOW), Math.floor(Math.log10(Math.max(LOW, tops.reduce((a, b) => Math.min(a, b), Infinity)))));
  };
  const bar = make(map, "path", { class: "compass" }), barText = make(map, "text", { "text-anchor": "middle" });
  make(make(map, "g", { transform: "translate(14 26)", class: "compass" }), "path", { d: "M0 6V-10M-4 -4L0 -10L4 -4" });
  make(map, "text", { x: 14, y: 46, "text-anchor": "middle" }, "N");

  // From metres to pixels: the whole box, or twelve lengths around the first target.
  const frame = () => {
    if (!near.checked) {
      const k = Math.min(width / (box[2] - box[0]), height / (box[3] - box[1]));
      return { k, ox: width / 2 - k * (box[0] + box[2]) / 2, oy: height / 2 + k * (box[1] + box[3]) / 2 };
    }
    const { north, east } = at(runs[0], now), k = Math.min(width, height) / (12 * Math.max(...runs.map((run) => run.length)));
    return { k, ox: width / 2 - k * east, oy: height / 2 + k * north };
  };
  const scaleBar = (k) => {
    const length = round(width / 5 / k), x = width - 14 - k * length;
    set(bar, "d", `M${x} ${height - 10}v4h${k * length}v-4`);
    set(barText, "x", x + k * length / 2);
    set(barText, "y", height - 13);
    barText.textContent = `${length} m`;
  };
  const draw = () => {
    const { k, ox, oy } = frame();
    set(world, "transform", `matrix(${k} 0 0 ${-k} ${ox} ${oy})`);
    scaleBar(k);
    runs.forEach((run, place) => {
      const { i, x, y, psi, north, east } = at(run, now), over = now >= run.time[run.time.length - 1] && run.ending;
      const last = Math.min(i, row(run, run.counts)), here = ` ${y},${x}`;
      set(run.trail, "points", run.points.slice(0, last + 1).join(" ") + (now > run.counts ? "" : here));
      set(run.after, "points", now > run.counts ? run.points.slice(last, i + 1).join(" ") + here : "");
      const size = Math.max(1, LEAST / (k * run.length)) * k, c = Math.cos(psi), s = Math.sin(psi);
      const corners = HULL.map(([a, b]) => [a * run.length * size, b * Math.max(run.beam, run.length / 3.5) * size])
        .map(([a, b]) => [ox + k * y + a * s + b * c, oy - k * x - a * c + b * s]);
      set(run.hull, "points", corners.join(" "));
      [["x1", 2, 0], ["y1", 2, 1], ["x2", 3, 0], ["y2", 3, 1]].forEach(([name, corner, axis]) => set(run.stern, name, corners[corner][axis]));
      for (const part of [run.hull, run.stern]) part.classList.toggle("lost", !!(over || run.kept));
      for (const part of [run.cross, run.ring]) part.style.display = over || !run.x_d ? "none" : "";
      set(run.cross, "transform", `translate(${ox + k * east} ${oy - k * north})`);
      [["cx", ox + k * east], ["cy", oy - k * north], ["r", k * run.standoff]].forEach(([name, value]) => set(run.ring, name, value));
      stage.querySelectorAll(".key small")[place].textContent = over ? run.ending : "";
    });
    const x = across(now);
    set(cursor, "d", `M${x} ${TOP}V${tall - BASE}`);
    const first = runs[0], i = row(first, now), degrees = (name) => first[name][i].toFixed(5);
    const place = first.lat && first.lat[i] !== null ? `, ${first.label} at ${degrees("lat")}, ${degrees("lon")} deg` : "";
    output.textContent = `t = ${now.toFixed(end < 20 ? 2 : 1)} s${place}`;
    slider.value = now;
  };

  const across = (t) => LEFT + (wide - LEFT - RIGHT) * t / end;
  const up = (z) => TOP + (tall - TOP - BASE) * (high - Math.log10(Math.min(Math.max(z, LOW), 10 ** (high + 1)))) / (high - low);
  let cursor;
  const drawTrace = () => {
    wide = Math.max(200, trace.clientWidth);
    trace.replaceChildren();
    set(trace, "viewBox", `0 0 ${wide} ${tall}`);
    for (let power = low; power <= high; power++) {
      make(trace, "path", { d: `M${LEFT} ${up(10 ** power)}H${wide - RIGHT}`, class: "rule" });
      make(trace, "text", { x: LEFT - 6, y: up(10 ** power) + 4, "text-anchor": "end" }, `${+(10 ** power).toFixed(3)} m`);
    }
    const clip = make(make(trace, "clipPath", { id: "inside" }), "rect", { x: LEFT, y: TOP, width: Math.max(0, wide - LEFT - RIGHT), height: tall - TOP - BASE });
    const inside = make(trace, "g", { "clip-path": "url(#inside)", fill: "none" });
    for (const run of traced) {
      const points = run.distance.map((z, i) => (z === null ? "" : `${across(run.time[i]).toFixed(1)},${up(z).toFixed(1)}`)), last = row(run, run.counts);
      if (last < points.length - 1) make(inside, "polyline", { ...line(run, 1.4), points: points.slice(last).join(" "), class: "after" });
      make(inside, "polyline", { ...line(run, 1.4), points: points.slice(0, last + 1).join(" ") });
    }
    const tick = round(Math.max(end / 5, 110 * end / wide));
    for (let i = 0; i * tick <= end; i++) make(trace, "text", { x: across(i * tick), y: tall - 5, "text-anchor": "middle" }, `${+(i * tick).toPrecision(6)} s`);
    cursor = make(trace, "path", { class: "cursor" });
    trace.style.display = traced.length ? "" : "none";
  };
  // The map has the shape of the course: above the rest, or beside it where it comes out nearly as large there.
  const place = () => {
    const ratio = (box[2] - box[0]) / (box[3] - box[1]), room = stage.clientWidth - 18, most = Math.min(560, 0.8 * Math.max(innerHeight, 500));
    const fitting = (free) => Math.min(free, most * ratio), beside = fitting(room - REST);
    const aside = room > 2 * REST && beside >= 0.85 * fitting(room);
    stage.classList.toggle("aside", aside);
    width = Math.max(aside ? beside : room, LEAST_MAP);
    height = Math.round(Math.min(Math.max(width / ratio, LEAST_MAP), most));
    set(map, "viewBox", `0 0 ${width} ${height}`);
    set(map, "style", `width: ${width}px; height: ${height}px`);
    tall = aside ? Math.max(LOWEST, height - BELOW) : LOWEST;
    drawTrace();
    draw();
  };

  const step = (stamp) => {
    if (!playing) return;
    now = Math.min(end, now + Math.max(0, stamp - last) / 1000 * speed.value);
    last = stamp;
    draw();
    if (now >= end) toggle(false); else requestAnimationFrame(step);
  };
  const toggle = (on = !playing) => {
    if (on === playing) return;
    playing = on;
    button.textContent = on ? "Pause" : "Play";
    if (on && now >= end) now = 0;
    if (on) requestAnimationFrame((stamp) => { last = stamp; step(stamp); });
  };
  const seek = (t) => { toggle(false); now = Math.min(end, Math.max(0, t)); draw(); };

  for (const factor of [0.1, 0.5, 1, 2, 5, 10, 20, 50, 100]) speed.add(new Option(`${factor}\u00d7`, factor));
  const pace = () => speed.value = [...speed.options].map((option) => option.value).findLast((factor) => factor <= Math.max(0.1, end / 25));
  button.addEventListener("click", () => toggle());
  slider.addEventListener("input", () => seek(slider.valueAsNumber));
  near.addEventListener("change", draw);
  stage.addEventListener("keydown", (event) => {
    const free = !event.target.closest("button, select, input"), stride = event.shiftKey ? end / 20 : end / 200;
    const jump = { ArrowLeft: now - stride, ArrowRight: now + stride, Home: 0, End: end }[event.key];
    if (event.key === " " && (free || event.target === slider)) toggle();
    else if (jump !== undefined && event.target !== speed) seek(jump);
    else return;
    event.preventDefault();
  });
  addEventListener("resize", place);
  return {
    seek, toggle,
    // Pixels of the map for metres north and east, and metres for pixels.
    toMap(north, east) { const { k, ox, oy } = frame(); return [ox + k * east, oy - k * north]; },
    toWorld(x, y) { const { k, ox, oy } = frame(); return [(oy - y) / k, (x - ox) / k]; },
    // Runs to show at a time, by default at that of the runs before.
    show(data, t = now) {
      const first = !runs.length;
      ({ box, end, runs } = data);
      slider.max = end;
      if (first) pace();
      now = Math.min(end, t);
      lay();
      place();
    },
  };
};
if (document.getElementById("chase-data")) {
  const stage = document.getElementById("stage"), { show, seek, toggle } = chaseOn(stage);
  show(JSON.parse(document.getElementById("chase-data").textContent));
  const asked = () => /^#t=([\d.]+)$/.exec(location.hash);
  addEventListener("hashchange", () => { if (asked()) { seek(+asked()[1]); stage.scrollIntoView(); } });
  if (asked()) { seek(+asked()[1]); stage.scrollIntoView(); }
  else if (!matchMedia("(prefers-reduced-motion: reduce)").matches) {
    new IntersectionObserver((seen, observer) => {
      if (seen.some((entry) => entry.isIntersecting)) { observer.disconnect(); toggle(true); }
    }, { threshold: 0.3 }).observe(stage);
  }
}
