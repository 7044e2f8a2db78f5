(() => {
  const one = (id) => document.getElementById(id), REST = 250, IDLE = 600; // ms without a move until all is computed, and from then to the margins
  const tracks = chaseOn(one("stage")), curves = curvesOn(one("plot"));
  let latest = "", moved = new Map(), rows = new Map(), signals = [], last = null, ghost = null, busy = false, wanted = null, pause = 0, judged = new Map(), values = new Map(), heldBox = null, several = false, alone = "", added = new Set();
  const add = (parent, tag, properties = {}) => parent.appendChild(Object.assign(document.createElement(tag), properties));
  const ask = async (name, question) => {
    const answer = await fetch(BASE + name, {
      method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ moved: Object.fromEntries(moved), ...question }),
    });
    return answer.ok ? answer.json() : { refused: [{ key: "", text: await answer.text() }] };
  };

  // One question at a time; what moves meanwhile is asked next, and only the newest.
  const want = (question = {}) => {
    wanted = { signals, rest: false, controls: false, ...(wanted ?? {}), ...question, since: wanted?.since ?? performance.now() };
    clearTimeout(pause);
    one("state").textContent = "...";
    one("margins").classList.add("old");
    if (!busy) send();
  };
  // A question that can wait until nothing moves, and which every move follows.
  const askAlone = async (name, question, words) => {
    if (busy) return { refused: [{ key: "", text: "still simulating; try again" }] };
    [busy, one("state").textContent] = [true, words];
    try {
      return await ask(name, question);
    } finally {
      [busy, one("state").textContent] = [false, ""];
      if (wanted) send();
    }
  };
  const send = async () => {
    const question = wanted, late = setTimeout(() => { one("state").textContent = "simulating or translating ..."; }, 400);
    [busy, wanted] = [true, null];
    try {
      const frame = await ask("frame", question);
      if (wanted) send(); else busy = false;
      show(frame, question);
      if (!wanted && !question.rest) pause = setTimeout(() => want({ rest: true }), REST);
      else if (!wanted && !frame.refused) pause = setTimeout(showMargins, IDLE);
    } catch {
      [busy, one("state").textContent] = [false, "podusv live has ended; start it again and reload this page"];
    }
    clearTimeout(late);
  };

  const show = (frame, question) => {
    document.querySelectorAll(".value .no, #told .refused").forEach((old) => old.remove());
    if (frame.refused) {
      one("state").textContent = "refused; the curves are those before";
      for (const { key, text } of frame.refused) {
        if (text.startsWith("missing")) lack(key);
        add((rows.get(key) ?? rows.get(latest))?.row ?? add(one("told"), "p", { className: "no refused" }), "div", { className: "no", textContent: text, role: "alert" });
      }
      return;
    }
    last = frame;
    if (frame.controls) lay(frame);
    draw(!question.rest && !question.controls);
    one("command").textContent = frame.command;
    judge(frame.verdicts, !!frame.findings);
    one("limits").textContent = Object.entries(frame.limits).filter(([, text]) => text).map(([label, text]) => `${label} is ${text}.`).join(" ");
    if (frame.findings) { // at rest, as an address for every move would be too many for browsers
      history.replaceState(null, "", `#${[...moved].map(([key, value]) => `${key}=${encodeURIComponent(value)}`).join("&")}`);
      one("told").replaceChildren();
      for (const [text, labels] of frame.findings) add(one("told"), "p", { className: "shown", textContent: `${labels.join(", ")}: ${text}` });
    }
    one("state").textContent = frame.findings ? "" : "...";
    window.seen = { since: question.since, cpu: frame.cpu, frames: (window.seen?.frames ?? 0) + 1 };
    requestAnimationFrame(() => setTimeout(() => { window.seen.drawn = performance.now(); window.spans?.push([window.seen.drawn - question.since, frame.cpu]); }));
  };
  // Claims with their verdicts; one that turns says between which values.
  const judge = (verdicts, rest) => {
    const list = one("verdicts"), at = { key: latest, value: moved.get(latest) };
    if (rest) for (const name of [...judged.keys()]) if (!verdicts.some((v) => v.name === name)) judged.delete(name);
    for (const verdict of verdicts) {
      const before = judged.get(verdict.name), turned = before && before.answer !== verdict.answer;
      const from = before?.at.key === at.key && before?.at.value !== undefined ? `${before.at.value}` : "the value before";
      const note = turned ? `${verdict.name} turned: ${before.words} at ${from}, ${verdict.words} at ${at.key} = ${at.value ?? "its first value"}` : before?.note ?? "";
      if (turned) one("turned").textContent = note;
      judged.set(verdict.name, { ...verdict, at, note });
    }
    if (list.children.length !== judged.size) {
      list.replaceChildren();
      for (const _ of judged) { const line = add(list, "li"); add(line, "b"); line.append(" "); add(line, "span"); line.append(" "); add(line, "small"); }
    }
    [...judged.values()].forEach(({ name, answer, words, says, evidence, note }, i) => {
      const [word, text, small] = list.children[i].children, kind = { true: "yes", false: "no" }[answer] ?? "open";
      const texts = [[word, words], [text, `${name}: ${says}`], [small, [evidence, note].filter(Boolean).join("; ")]];
      for (const [place, content] of texts) if (place.textContent !== content) place.textContent = content;
      if (word.className !== kind) word.className = kind;
    });
  };
  const showMargins = async () => {
    if (busy || wanted || !last) return;
    const { margins } = await askAlone("margins", {}, "margins ...");
    if (wanted || !margins) return;
    const place = one("margins"), laws = Object.entries(margins), having = laws.filter(([, law]) => law.rows.length);
    place.replaceChildren();
    place.classList.remove("old");
    if (having.length) {
      add(place, "p", { className: "shown", textContent: `at ${[...moved].map(([key, value]) => `${key} = ${value}`).join(", ") || "the values of the file"}` });
      table(add(add(place, "div", { className: "wide" }), "table", { className: "numbers" }), [
        ["", "unit", ...having.map(([label]) => label)],
        ...having[0][1].rows.map(([, meaning, unit], i) => [meaning, unit, ...having.map(([, law]) => inWords(law.rows[i][3]))]),
      ]);
    }
    for (const why of new Set(laws.map(([, law]) => law.why).filter(Boolean)))
      add(place, "p", { className: "shown", textContent: `${laws.filter(([, law]) => law.why === why).map(([label]) => label).join(", ")}: no margins, as ${why}` });
  };
  const inWords = (x) => (typeof x === "number" ? `${+x.toPrecision(4)}` : x ?? "-");
  const named = ({ label, ...run }) => ({ label: `${label}, kept`, ...run, kept: true });
  // Waypoints on the map, which a hand drags; their sliders move the same values.
  const map = one("stage").querySelector(".map"), grips = make(map, "g");
  const waypoint = (i) => [0, 1].map((axis) => `path.points[${i}][${axis}]`);
  const drawGrips = () => {
    let count = 0;
    while (values.has(waypoint(count)[0])) count++;
    while (grips.children.length > count) grips.lastChild.remove();
    while (grips.children.length < count) addGrip(grips.children.length);
    [...grips.children].forEach((grip, i) => {
      const [x, y] = tracks.toMap(...waypoint(i).map((key) => moved.get(key) ?? values.get(key)));
      set(grip, "cx", x);
      set(grip, "cy", y);
    });
  };
  const addGrip = (i) => {
    const grip = make(grips, "circle", { r: 8, class: "grip" });
    make(grip, "title", {}, `waypoint ${i + 1}: drag it`);
    grip.addEventListener("pointerdown", (event) => {
      grip.setPointerCapture(event.pointerId);
      heldBox = last.chase.box; // the map does not move below the hand
      event.preventDefault();
    });
    grip.addEventListener("pointermove", (event) => {
      if (!heldBox) return;
      const { left, top, width } = map.getBoundingClientRect(), scale = map.viewBox.baseVal.width / width;
      const place = tracks.toWorld((event.clientX - left) * scale, (event.clientY - top) * scale);
      latest = waypoint(i)[0];
      waypoint(i).forEach((key, axis) => moved.set(key, +place[axis].toFixed(2)));
      want();
    });
    for (const end of ["pointerup", "pointercancel"]) grip.addEventListener(end, () => {
      if (!heldBox) return;
      heldBox = null;
      want({ controls: true, rest: true });
    });
  };
  one("stage").querySelector("input[type=checkbox]").addEventListener("change", (event) => { grips.style.display = event.target.checked ? "none" : ""; });
  addEventListener("resize", drawGrips);
  const draw = (hold) => {
    const runs = [...(ghost?.curves.runs ?? []), ...last.curves.runs], tracked = [...(ghost?.chase.runs ?? []), ...last.chase.runs];
    legend(one("stage").querySelector(".key"), tracked, false);
    legend(one("plot").querySelector(".key"), runs, true);
    const same = ghost && JSON.stringify(ghost.curves.signals.map((s) => s.name)) === JSON.stringify(last.curves.signals.map((s) => s.name));
    curves.show({ signals: last.curves.signals, runs: same ? runs : last.curves.runs }, hold);
    tracks.show({ ...last.chase, runs: tracked, box: heldBox ?? last.chase.box }, last.chase.end);
    drawGrips();
    const old = (name, i) => ghost.numbers.find((row) => row.name === name)?.values[i];
    table(one("numbers"), [
      ["", "unit", ...runs.map((run) => run.label)],
      ...last.numbers.map(({ name, row, unit, values }) => [row, unit, ...(ghost?.curves.runs ?? []).map((_, i) => inWords(old(name, i))), ...values.map(inWords)]),
    ]);
    one("endings").textContent = Object.entries(last.endings).map(([label, text]) => `${label} ${text.split(";")[0]}`).join("\n");
  };
  // Only texts that differ are written, as a table that is made anew costs the page a layout.
  const table = (place, lines) => {
    const shape = lines.map((cells) => cells.length).join();
    if (place.dataset.shape !== shape) {
      [place.dataset.shape, place.textContent] = [shape, ""];
      lines.forEach((cells, row) => { const line = add(place, "tr"); cells.forEach((_, i) => add(line, row ? "td" : "th", { className: i > 1 ? "number" : "", ...(row ? {} : { scope: "col" }) })); });
    }
    lines.forEach((cells, row) => cells.forEach((text, i) => { const cell = place.rows[row].cells[i]; if (cell.textContent !== text) cell.textContent = text; }));
  };
  const legend = (list, runs, boxes) => {
    const names = runs.map((run) => run.label).join("\n");
    if (list.dataset.names === names) return;
    list.dataset.names = names;
    list.replaceChildren();
    for (const run of runs) {
      const label = add(add(list, "li"), "label");
      if (boxes) add(label, "input", { type: "checkbox", checked: true });
      make(make(label, "svg", { viewBox: "0 0 32 10", width: 32, height: 10 }), "path", { d: "M1 5H31", ...line(run, 2.5), opacity: run.kept ? 0.35 : 1 });
      label.append(` ${run.label}`);
      add(label.parentNode, "small");
    }
  };

  const shown = (x) => +(+x).toPrecision(3);
  const lay = (frame) => {
    const open = new Set([...document.querySelectorAll("#parts details[open]")].map((part) => part.dataset.part));
    rows = new Map();
    values = new Map(frame.controls.map(({ key, value }) => [key, value]));
    one("parts").replaceChildren();
    if (one("add").length === 1) for (const kind of frame.kinds) add(one("add"), "option", { value: kind, textContent: kind });
    [several, alone, added] = [frame.several, frame.alone, new Set(frame.added.map((label) => `controllers.${label}`))];
    one("name").value ||= `${frame.name}_live`;
    const parts = new Map();
    for (const control of frame.controls) {
      if (!parts.has(control.part)) {
        const part = add(one("parts"), "details", { open: parts.size < 2 || open.has(control.part) });
        part.dataset.part = control.part;
        add(part, "summary", { textContent: control.part });
        if (added.has(control.part)) {
          const away = add(part, "button", { type: "button", textContent: "remove this law" });
          away.addEventListener("click", () => remove(control.part));
        }
        parts.set(control.part, part);
      }
      rows.set(control.key, slide(parts.get(control.part), control));
    }
    if (one("signals").children.length === 1) for (const name of frame.signals) {
      const box = add(add(one("signals"), "label", { textContent: `${name} ` }), "input", { type: "checkbox", value: name, checked: frame.curves.signals.some((s) => s.name === name) });
      box.addEventListener("change", () => { signals = [...one("signals").querySelectorAll("input:checked")].map((b) => b.value); want({ signals }); });
    }
  };
  // A box for a number that a kind needs and nobody gave yet.
  const lack = (key) => {
    if (rows.has(key)) return;
    const row = add(rows.get(latest)?.row.parentNode ?? one("parts"), "div", { className: "value" });
    const box = add(add(row, "label", { textContent: key }), "input", { type: "number", step: "any", id: `v-${key}` });
    box.addEventListener("change", () => { moved.set(key, +box.value); want({ controls: true, rest: true }); });
    rows.set(key, { row });
  };
  const slide = (part, { key, name, meaning, value, unit, range, low, high, log, quantum, choices, by_rule, default: usual }) => {
    const row = add(part, "div", { className: "value" }), id = `v-${key}`;
    const label = add(row, "label", { htmlFor: id, title: `${key} ${range} [${unit}], default ${usual}` });
    add(label, "b", { textContent: name }); label.append(` ${unit && `[${unit}]`} `); add(label, "small", { textContent: meaning + (by_rule ? " (follows from hull and actuator)" : "") });
    row.classList.toggle("moved", moved.has(key));
    const move = (x, question) => { latest = key; moved.set(key, x); row.classList.add("moved"); want(question); };
    if (choices.length) {
      const menu = add(row, "select", { id });
      for (const word of choices) add(menu, "option", { value: word, textContent: word, selected: word === value });
      menu.addEventListener("change", () => {
        if (name === "kind") for (const other of [...moved.keys()]) if (other.startsWith(key.slice(0, -4)) && other !== key) moved.delete(other);
        move(menu.value, { controls: true, rest: true });
      });
      return { row };
    }
    // Of a logarithmic slider the numbers have one sign, and `low` is not 0.
    const sign = low < 0 ? -1 : 1, to = (x) => (log ? sign * Math.log(Math.abs(x)) : x), from = (p) => (log ? sign * Math.exp(sign * p) : p);
    const snap = (x) => (quantum ? +(Math.round(x / quantum) * quantum).toPrecision(9) : shown(x));
    const range_ = add(row, "input", { type: "range", id, min: to(low), max: to(high), step: (to(high) - to(low)) / 1000, value: to(value) });
    const typed = add(row, "input", { type: "number", step: "any", value: shown(value) });
    typed.setAttribute("aria-label", `${key}, typed`);
    range_.setAttribute("aria-valuetext", `${shown(value)} ${unit}`);
    range_.addEventListener("input", () => { typed.value = snap(from(+range_.value)); range_.setAttribute("aria-valuetext", `${typed.value} ${unit}`); move(+typed.value); });
    range_.addEventListener("dblclick", () => { moved.delete(key); want({ controls: true, rest: true }); });
    typed.addEventListener("change", () => { if (typed.value !== "") move(+typed.value, { controls: true, rest: true }); });
    return { row };
  };

  one("keep").addEventListener("click", () => {
    ghost = ghost ? null : { ...last, curves: { ...last.curves, runs: last.curves.runs.map(named) }, chase: { ...last.chase, runs: last.chase.runs.map(named) } };
    one("keep").textContent = ghost ? "Let go" : "Keep";
    draw(false);
  });
  one("undo").addEventListener("click", () => {
    [moved, one("turned").textContent] = [new Map(), ""];
    judged.clear();
    want({ controls: true, rest: true });
  });
  // A law more. The one of a scenario that has one goes among several, with what was moved of it.
  one("add").addEventListener("change", () => {
    const kind = one("add").value, labels = last.curves.runs.map((run) => run.label);
    if (!kind) return;
    let label = kind;
    for (let i = 2; labels.includes(label); i++) label = `${kind}_${i}`;
    const own = several ? [...moved] : [...moved].map(([key, value]) => [key.replace(/^controller\./, `controllers.${labels[0]}.`), value]);
    const part = `controllers.${label}`;
    moved = new Map([[`${part}.kind`, kind], ...own]);
    [latest, one("add").value] = [`${part}.kind`, ""];
    want({ controls: true, rest: true });
  });
  const remove = (part) => {
    for (const key of [...moved.keys()]) if (key.startsWith(`${part}.`)) moved.delete(key);
    if (alone && added.size === 1) moved = new Map([...moved].map(([key, value]) => [key.replace(`controllers.${alone}.`, "controller."), value]));
    want({ controls: true, rest: true });
  };
  // A page of the browser's own, as this one has no other address; it is written beside the results.
  one("report").addEventListener("click", async () => {
    const made = await askAlone("report", {}, "writing the report ..."), place = one("saved");
    if (made.refused) { place.textContent = made.refused.map(({ text }) => text).join("\n"); return; }
    place.textContent = `${made.file}\n`;
    add(place, "a", { textContent: "open the report", target: "_blank", href: URL.createObjectURL(new Blob([made.page], { type: "text/html" })) });
  });
  one("save").addEventListener("click", async () => {
    const told = await ask("save", { name: one("name").value });
    one("saved").textContent = told.refused ? told.refused.map(({ text }) => text).join("\n") : `${told.file}\n\n${told.text}\n${told.command}`;
  });
  for (const pair of location.hash.slice(1).split("&").filter(Boolean)) {
    const [key, text] = pair.split("="), value = decodeURIComponent(text);
    moved.set(key, value === "" || Number.isNaN(+value) ? value : +value);
  }
  want({ controls: true, rest: true });
})();
