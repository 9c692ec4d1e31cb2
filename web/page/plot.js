// Line plots as SVG. `series`: { kind: "line" | "band", x, y, low, high, style, label }; `x` increases.
const RIGHT = 12, BOTTOM = 40;
const short = (value) => value === 0 ? "0" : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3 ? value.toExponential(1).replace(".0e", "e").replace("e+", "e") : `${+value.toPrecision(4)}`;
const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

function ticks(from, to, count) {
  const raw = (to - from) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) ?? raw;
  const marks = [];
  for (let k = Math.ceil(from / step); k * step <= to + step * 1e-9 && marks.length < 50; k++) marks.push(k * step);
  return marks;
}

// First index whose x is at least `value`.
function firstAt(xs, value) {
  let low = 0, high = xs.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (xs[middle] < value) low = middle + 1; else high = middle;
  }
  return low;
}

// Calls `flush(columns)` for every stretch without gaps; a column is a pixel with the lowest and highest value in it, and the last.
function columns(xs, lows, highs, x, flush) {
  let stretch = [], now;
  const end = () => { if (stretch.length) flush(stretch); stretch = []; now = undefined; };
  for (let i = 0; i < xs.length; i++) {
    const low = lows[i], high = highs[i];
    if (!Number.isFinite(low) || !Number.isFinite(high)) { end(); continue; }
    const at = Math.round(x(xs[i]) * 2) / 2;
    if (now?.at !== at) stretch.push(now = { at, low, high, first: low });
    if (low < now.low) now.low = low;
    if (high > now.high) now.high = high;
    now.last = high;
  }
  end();
}

function linePath(xs, ys, x, y) {
  let text = "";
  columns(xs, ys, ys, x, (stretch) => {
    text += "M" + stretch.map(({ at, low, high, first, last }) =>
      [first, low, high, last].filter((v, i, all) => i === 0 || v !== all[i - 1]).map((v) => `${at},${y(v).toFixed(1)}`).join("L")).join("L");
    if (stretch.length === 1) text += "h.1";
  });
  return text;
}

function bandPath(xs, lows, highs, x, y) {
  let text = "";
  columns(xs, lows, highs, x, (stretch) => {
    const upper = stretch.map(({ at, high }) => `${at},${y(high).toFixed(1)}`), lower = stretch.map(({ at, low }) => `${at},${y(low).toFixed(1)}`).reverse();
    text += `M${upper.concat(lower).join("L")}Z`;
  });
  return text;
}

function extent(arrays) {
  let from = Infinity, to = -Infinity;
  for (const values of arrays) for (const value of values) if (Number.isFinite(value)) { if (value < from) from = value; if (value > to) to = value; }
  if (!(from <= to)) return [0, 1];
  const pad = from === to ? Math.max(Math.abs(from) * .01, 1e-9) : (to - from) * .04;
  return [from - pad, to + pad];
}

// Draws, and returns the scales. Only samples within `xRange` are looked at.
function draw(svg, { series, xLabel, yLabel, xRange, yRange, xTicks, yTicks, xText = short, extra = () => "" }) {
  const width = Math.max(280, svg.clientWidth || 900), height = Math.max(150, svg.clientHeight || 320);
  const [x0, x1] = xRange ?? extent(series.map((one) => one.x));
  const seen = series.map((one) => {
    const from = Math.max(0, firstAt(one.x, x0) - 1), to = firstAt(one.x, x1) + 1, cut = (values) => values?.slice(from, to);
    return { ...one, x: cut(one.x), y: cut(one.y), low: cut(one.low), high: cut(one.high) };
  });
  const [y0, y1] = yRange ?? extent(seen.flatMap((one) => one.kind === "band" ? [one.low, one.high] : [one.y]));
  // Labels of the legend in as many rows as they need.
  const left = 64;
  let at = left, row = 0;
  const legend = seen.filter((one) => one.label).map((one) => {
    const length = 40 + 7.2 * one.label.length;
    if (at + length > width && at > left) { at = left; row += 1; }
    const y = 12 + 18 * row, look = one.kind === "band" ? `<rect class="band" x="${at}" y="${y - 6}" width="18" height="11"/>` : `<line class="${one.style}" x1="${at}" x2="${at + 18}" y1="${y}" y2="${y}"/>`;
    const text = `${look}<text x="${at + 23}" y="${y + 4}">${escaped(one.label)}</text>`;
    at += length;
    return text;
  });
  const top = legend.length ? 26 + 18 * row : 10, right = width - RIGHT, bottom = height - BOTTOM;
  const x = (v) => left + (right - left) * (v - x0) / (x1 - x0), y = (v) => bottom - (bottom - top) * (v - y0) / (y1 - y0);
  const marks = (xTicks ?? ticks(x0, x1, width < 500 ? 4 : 7)).map((t) => `<line class="grid-line" x1="${x(t)}" x2="${x(t)}" y1="${top}" y2="${bottom}"/><text x="${x(t)}" y="${height - 22}" text-anchor="middle">${escaped(xText(t))}</text>`)
    .concat((yTicks ?? ticks(y0, y1, 5).map((t) => [t, short(t)])).map(([t, text]) => `<line class="grid-line" x1="${left}" x2="${right}" y1="${y(t)}" y2="${y(t)}"/><text x="${left - 6}" y="${y(t) + 4}" text-anchor="end">${escaped(text)}</text>`));
  const body = seen.map((one) => one.kind === "band" ? `<path class="band" d="${bandPath(one.x, one.low, one.high, x, y)}"/>` : `<path class="${one.style}" d="${linePath(one.x, one.y, x, y)}"/>`);
  const clip = `${svg.id}-clip`, middle = (top + bottom) / 2;
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.innerHTML = `<clipPath id="${clip}"><rect x="${left}" y="${top}" width="${right - left}" height="${bottom - top}"/></clipPath>${marks.join("")}
    <rect class="frame" x="${left}" y="${top}" width="${right - left}" height="${bottom - top}"/><g clip-path="url(#${clip})">${body.join("")}${extra(x, y)}</g>
    ${legend.join("")}<text x="${(left + right) / 2}" y="${height - 5}" text-anchor="middle">${escaped(xLabel)}</text>
    <text x="14" y="${middle}" text-anchor="middle" transform="rotate(-90 14 ${middle})">${escaped(yLabel)}</text>`;
  return { x, y, range: [x0, x1], toX: (pixel) => x0 + (x1 - x0) * (pixel - left) / (right - left) };
}
