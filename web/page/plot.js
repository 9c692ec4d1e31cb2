// Line plots as SVG. `series`: { kind: "line" | "band", x, y, low, high, style, label }.
const LEFT = 64, RIGHT = 12, TOP = 26, BOTTOM = 40;
const short = (value) => value === 0 ? "0" : Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3 ? value.toExponential(1) : `${+value.toPrecision(4)}`;
const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => ({ "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" })[c]);

function ticks(from, to, count) {
  const raw = (to - from) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) ?? raw;
  const marks = [];
  for (let k = Math.ceil(from / step); k * step <= to + step * 1e-9; k++) marks.push(k * step);
  return marks;
}

// Each column of pixels keeps its lowest and highest sample, so a long series draws as it looks.
function path(xs, ys, x, y) {
  let text = "", open = false, column = -1, low, high, last;
  const flush = () => {
    if (column < 0) return;
    text += `${open ? "L" : "M"}${column},${y(low).toFixed(1)}${high === low ? "" : `L${column},${y(high).toFixed(1)}`}${last === low || last === high ? "" : `L${column},${y(last).toFixed(1)}`}`;
    open = true;
  };
  for (let i = 0; i < ys.length; i++) {
    const value = ys[i];
    if (!Number.isFinite(value)) { flush(); column = -1; open = false; continue; }
    const at = Math.round(x(xs[i]) * 2) / 2;
    if (at !== column) { flush(); column = at; low = high = value; }
    low = Math.min(low, value); high = Math.max(high, value); last = value;
  }
  flush();
  return text;
}

function extent(arrays) {
  let from = Infinity, to = -Infinity;
  for (const values of arrays) for (const value of values) if (Number.isFinite(value)) { if (value < from) from = value; if (value > to) to = value; }
  if (!(from <= to)) return [0, 1];
  const pad = from === to ? Math.max(Math.abs(from) * .01, 1e-9) : (to - from) * .04;
  return [from - pad, to + pad];
}

function draw(svg, { series, xLabel, yLabel, xRange, extra = "" }) {
  const WIDTH = Math.max(280, svg.clientWidth || 900), HEIGHT = Math.max(200, svg.clientHeight || 320);
  const [x0, x1] = xRange ?? extent(series.map((one) => one.x)), inside = (one, ys) => Array.prototype.filter.call(ys, (_, i) => one.x[i] >= x0 && one.x[i] <= x1);
  const [y0, y1] = extent(series.flatMap((one) => one.kind === "band" ? [inside(one, one.low), inside(one, one.high)] : [inside(one, one.y)]));
  const x = (v) => LEFT + (WIDTH - LEFT - RIGHT) * (v - x0) / (x1 - x0), y = (v) => HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (v - y0) / (y1 - y0);
  const clipId = `${svg.id}-clip`;
  const marks = ticks(x0, x1, WIDTH < 500 ? 4 : 7).map((t) => `<line class="grid" x1="${x(t)}" x2="${x(t)}" y1="${TOP}" y2="${HEIGHT - BOTTOM}"/><text x="${x(t)}" y="${HEIGHT - 22}" text-anchor="middle">${short(t)}</text>`)
    .concat(ticks(y0, y1, 5).map((t) => `<line class="grid" x1="${LEFT}" x2="${WIDTH - RIGHT}" y1="${y(t)}" y2="${y(t)}"/><text x="${LEFT - 6}" y="${y(t) + 4}" text-anchor="end">${short(t)}</text>`));
  let at = LEFT;
  const legend = series.filter((one) => one.label).map((one) => {
    const text = one.kind === "band" ? `<rect class="band" x="${at}" y="6" width="18" height="11"/>` : `<line class="${one.style}" x1="${at}" x2="${at + 18}" y1="12" y2="12"/>`;
    const shown = `${text}<text x="${at + 23}" y="16">${escaped(one.label)}</text>`;
    at += 40 + 7.2 * one.label.length;
    return shown;
  });
  const body = series.map((one) => {
    if (one.kind === "band") {
      const upper = path(one.x, one.high, x, y), lower = [];
      for (let i = one.x.length - 1; i >= 0; i -= Math.max(1, Math.floor(one.x.length / 1800))) if (Number.isFinite(one.low[i])) lower.push(`L${x(one.x[i]).toFixed(1)},${y(one.low[i]).toFixed(1)}`);
      return `<path class="band" d="${upper.replace(/(?!^)M/g, "L")}${lower.join("")}Z"/>`;
    }
    return `<path class="${one.style}" d="${path(one.x, one.y, x, y)}"/>`;
  });
  svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
  svg.innerHTML = `<clipPath id="${clipId}"><rect x="${LEFT}" y="${TOP}" width="${WIDTH - LEFT - RIGHT}" height="${HEIGHT - TOP - BOTTOM}"/></clipPath>${marks.join("")}
    <rect class="frame" x="${LEFT}" y="${TOP}" width="${WIDTH - LEFT - RIGHT}" height="${HEIGHT - TOP - BOTTOM}"/><g clip-path="url(#${clipId})">${body.join("")}${typeof extra === "function" ? extra(x, y) : extra}</g>
    ${legend.join("")}<text x="${(LEFT + WIDTH - RIGHT) / 2}" y="${HEIGHT - 5}" text-anchor="middle">${escaped(xLabel)}</text>
    <text x="14" y="${(TOP + HEIGHT - BOTTOM) / 2}" text-anchor="middle" transform="rotate(-90 14 ${(TOP + HEIGHT - BOTTOM) / 2})">${escaped(yLabel)}</text>`;
  return { x, y, toX: (pixel) => x0 + (x1 - x0) * (pixel - LEFT) / (WIDTH - LEFT - RIGHT) };
}
