"use strict";
// What the animation and the curves have in common.
const make = (parent, tag, attributes = {}, text = "") => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.textContent = text;
  return parent.appendChild(element);
};
const set = (element, name, value) => element.setAttribute(name, value);
const line = (run, weight) => ({ stroke: run.color, "stroke-width": weight, "stroke-dasharray": run.dash.map((d) => d * weight).join(" ") });
// The largest of 1, 2, 5, 10, 20, ... that is not above.
const round = (most) => {
  const power = 10 ** Math.floor(Math.log10(most));
  return +([5, 2, 1].find((n) => n * power <= most) * power).toPrecision(1);
};
