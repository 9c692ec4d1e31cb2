const get = (id) => document.getElementById(id);
const worker = new Worker(URL.createObjectURL(new Blob([get("worker").textContent], { type: "text/javascript" })));
worker.postMessage({ module: Uint8Array.from(atob(MODULE), (c) => c.charCodeAt(0)) });

const waiting = new Map();
let questions = 0;
function ask(question, given = {}, transfer = []) {
  const id = ++questions;
  return new Promise((resolve, reject) => {
    waiting.set(id, { resolve, reject });
    worker.postMessage({ id, question, given }, transfer);
  });
}
worker.onmessage = ({ data: { id, answer, problem } }) => {
  const { resolve, reject } = waiting.get(id);
  waiting.delete(id);
  problem === undefined ? resolve(answer) : reject(new Error(problem));
};
worker.onerror = (problem) => { get("table-problem").textContent = problem.message; };

// Runs `work` once at a time; calls that come meanwhile become one more run.
function latest(work) {
  let runs = false, again = false;
  return async () => {
    if (runs) { again = true; return; }
    runs = true;
    try {
      do { again = false; await work(); } while (again);
    } finally { runs = false; }
  };
}

function download(name, type, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// Tabs, by pointer and by arrow keys.
const tabs = [...document.querySelectorAll("[role=tab]")];
const shows = { "tab-bit": () => showBit(), "tab-frontier": () => showFrontier(), "tab-table": () => { showTable(); showPlan(); }, "tab-design": () => showDesign() };
function choose(tab) {
  for (const one of tabs) {
    const chosen = one === tab;
    one.setAttribute("aria-selected", chosen);
    one.tabIndex = chosen ? 0 : -1;
    get(one.getAttribute("aria-controls")).hidden = !chosen;
  }
  shows[tab.id]();
}
for (const [i, tab] of tabs.entries()) {
  tab.onclick = () => choose(tab);
  tab.onkeydown = (event) => {
    const to = { ArrowRight: i + 1, ArrowLeft: i - 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const next = tabs[(to + tabs.length) % tabs.length];
    next.focus();
    choose(next);
  };
}

// A table of the user.
const THOROUGH_CELLS = 200_000;
let table, values, planned, view;
const shareOf = (position) => 0.001 * 10 ** (position / 15); // per cent of the range: .001 to 10
const rounded = (value) => +value.toPrecision(2);
const percent = () => `${rounded(shareOf(+get("share").value))}%`;
const drawn = () => +get("drawn").value;
const quoted = (name) => `"${name.replaceAll('"', '""')}"`;
const shell = (text) => /^[\w.,:%+=\/±-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
const plain = (name) => /^[\w .-]+$/.test(name) && name.trim() === name ? name : quoted(name);


// The bounds in the language of `--bound`.
function bound() {
  const own = [...table.own].map(([i, text]) => `${plain(table.columns[i].name)}=${text}`);
  return [percent(), ...own].join(",");
}

// What the user said of the table. Names with commas are quoted.
function said() {
  const form = new FormData(get("said")), dialect = {}, names = (text) => (text.match(/"(?:[^"]|"")*"|[^,]+/g) ?? [])
    .map((name) => name.trim().replace(/^"(.*)"$/, (_, inner) => inner.replaceAll('""', '"'))).filter(Boolean);
  for (const [name, value] of form) {
    if (["without", "tolerance"].includes(name) || value === "") continue;
    dialect[name] = value === "on" ? true : ["missing", "time-column"].includes(name) ? names(value) : /^skip/.test(name) ? +value : value;
  }
  return { dialect, without: names(form.get("without")), tolerance: +form.get("tolerance"), numbered: form.get("tolerance") === "" };
}

async function take(name, bytes) {
  get("table-problem").textContent = "";
  get("table-state").textContent = `reading ${name} …`;
  const kept = { name, bytes, own: new Map(), said: said() };
  table = view = values = planned = undefined;
  try {
    table = { ...kept, ...await ask("open", { bytes, said: JSON.stringify(kept.said) }) };
  } catch (problem) {
    table = { ...kept, failed: true };
    get("table-found").hidden = true;
    get("table-state").textContent = "";
    get("table-problem").textContent = `${name}: ${problem.message}`;
    get("reading").open = true;
    document.body.dataset.packed = "failed";
    return;
  }
  get("drawn").replaceChildren(...table.columns.map((column, i) => new Option(column.name, i)));
  get("drawn").value = Math.max(0, table.columns.findIndex((column) => column.kind === "number" && column.max > column.min));
  // Fewer bits take some ten times the time: large tables begin without.
  get("thorough").checked = table.rows * table.columns.length <= THOROUGH_CELLS;
  get("table-found").hidden = false;
  await pack();
}

const pack = latest(async () => {
  if (!table || table.failed) return;
  const now = table;
  get("share-text").textContent = `${percent()} of each column's range`;
  get("verdict").textContent = "";
  try {
    const asked = bound(), column = drawn(), effort = get("thorough").checked ? "Thorough" : "Fast", packed = await ask("pack", { bound: asked, effort }), shown = await ask("values", { column });
    if (now !== table) return;
    now.packed = { ...packed, asked, effort };
    values = { ...shown, column };
    get("table-problem").textContent = "";
    showTable();
    const plan = await ask("plan", { column: values.column });
    if (now !== table) return;
    planned = { ...plan, column: values.column };
    showPlan();
  } catch (problem) {
    get("table-problem").textContent = problem.message;
  }
  document.body.dataset.packed = asksDone();
});
let packs = 0;
const asksDone = () => ++packs;

function notes() {
  const out = table.left_out.map(([name, why]) => `Column ${name} is left out: ${why}.`);
  const sentinels = table.columns.filter((column) => column.sentinel !== null).map((column) =>
    `${column.name}: ${short(column.sentinel)} in ${column.sentinel_cells} cells makes most of the range; if it means a gap, write ${plain(column.name)}=${column.sentinel} into --missing below.`);
  return [...out, ...sentinels, ...table.skipped];
}

function showTable() {
  if (!table?.packed) return;
  const { packed, time } = table, unit = (column) => column.unit && !column.words ? ` / ${column.unit}` : "", size = table.bytes.length;
  get("table-state").textContent = `${table.name}: ${table.rows} rows, ${table.columns.length} columns. ${size} bytes become ${packed.bytes} (${+(100 * packed.bytes / size).toPrecision(3)} %). ` +
    (time ? `Time ${time.columns.join(", ")} in ${time.scale}${time.from && `, ${time.from} to ${time.to}`}. ` : "Rows are numbered. ") + `Read as ${[table.format, table.dialect].filter(Boolean).join(", ")}.`;
  get("notes").replaceChildren(...notes().map((text) => Object.assign(document.createElement("li"), { textContent: text })));
  get("columns").tBodies[0].innerHTML = table.columns.map((column, i) => {
    const cost = packed.columns[i], of = cost.bound.includes("%") || cost.bound.startsWith("decimals") ? ` = ±${short(cost.delta)}` : "", exact = column.words ? `${column.words.length} words` : cost.bound + of;
    const end = (value) => value === null || column.words ? "" : short(value);
    return `<tr${i === drawn() ? ' class="drawn"' : ""}><th scope="row" title="${escaped(column.name)}">${escaped(column.name)}${escaped(unit(column))}</th><td>${escaped(exact)}</td><td>${cost.bits.toFixed(3)}</td><td>${cost.bytes}</td>
      <td>${column.samples}</td><td>${column.gaps}</td><td>${end(column.min)}</td><td>${end(column.max)}</td></tr>`;
  }).join("");
  const without = [...new Set([...table.said.without, ...table.left_out.map(([name]) => name)])];
  const options = [table.format === "recording" ? "" : table.options, time && !table.said.dialect["time-column"] ? `--time-column ${shell(time.columns.map(plain).join(","))}` : "",
    time ? `--time ${get("said").tolerance.selectedOptions[0].text}` : "", without.length ? `--without ${shell(without.map(plain).join(","))}` : "", packed.effort === "Fast" ? "--fast" : "", `--bound ${shell(packed.asked)}`];
  get("command").textContent = table.format === "recording" ? `fewbits unpack ${shell(table.name)} -o table.csv` : `fewbits pack ${shell(table.name)} ${options.filter(Boolean).join(" ")} -o out.fewb`;
  if (!values) return;
  const column = table.columns[values.column], { delta, bound } = packed.columns[values.column], x = Float64Array.from(values.original, (_, i) => i);
  get("own-text").value = bound;
  get("own-unit").textContent = column.words ? "words are exact" : `${column.unit ? `unit ${column.unit}; ` : ""}restored within ${delta === 0 ? "0: every bit is kept" : `±${short(delta)}`}`;
  get("own").value = delta === 0 ? 0 : Math.max(1, Math.round(1 + 15 * Math.log10(100 * delta / ((column.max - column.min) || 1) / 0.001)));
  for (const id of ["own", "own-text", "own-none"]) get(id).disabled = ["words", "boolean"].includes(column.kind);
  table.scale = draw(get("table-plot"), {
    series: [
      ...(delta > 0 ? [{ kind: "band", x, low: values.restored.map((v) => v - delta), high: values.restored.map((v) => v + delta), label: "restored ± bound" }] : []),
      { x, y: values.original, style: "ink", label: "original" },
      { x, y: values.restored, style: "one", label: "restored" },
    ],
    xLabel: "row", yLabel: `${column.name}${unit(column)}`, xRange: view,
  });
}

// Bits per sample against the bound, with the present bound.
function showPlan() {
  const svg = get("plan-plot");
  svg.style.display = planned?.bounds.length ? "" : "none";
  if (!planned?.bounds.length || !table?.packed) return;
  const column = table.columns[planned.column];
  const points = planned.bounds.filter(([, delta]) => delta > 0), x = Float64Array.from(points, ([, delta]) => Math.log10(delta)), { delta, bits } = table.packed.columns[planned.column];
  const from = Math.floor(x[0]), to = Math.ceil(x.at(-1));
  draw(svg, {
    series: [{ x, y: Float64Array.from(points, (point) => point[2]), style: "one", label: `first ${Math.min(table.rows, 4096)} rows alone; lossless ${planned.lossless_bits.toFixed(2)} bits` }],
    xLabel: `bound${column.unit && !column.words ? ` / ${column.unit}` : ""}`, yLabel: "bit/sample", xRange: [x[0] - .1, x.at(-1) + .1], yRange: [0, 1.1 * Math.max(points[0][2], delta > 0 ? bits : 0, .1)],
    xTicks: Array.from({ length: to - from + 1 }, (_, i) => from + i).filter((t) => t >= x[0] - .1 && t <= x.at(-1) + .1), xText: (t) => short(10 ** t),
    extra: (X, Y) => delta > 0 ? `<circle class="mark" cx="${X(Math.log10(delta))}" cy="${Y(bits)}" r="5"><title>now: ±${short(delta)}, ${bits.toFixed(3)} bits</title></circle>` : "",
  });
}

async function takeFile(file) {
  if (!file) return;
  choose(get("tab-table"));
  try {
    await take(file.name, new Uint8Array(await file.arrayBuffer()));
  } catch (problem) {
    get("table-state").textContent = "";
    get("table-problem").textContent = `${file.name} cannot be read: ${problem.message}`;
  }
}
get("file").onchange = ({ target }) => { takeFile(target.files[0]); target.value = ""; };
document.ondragover = (event) => { event.preventDefault(); document.body.classList.add("dropping"); };
document.ondragleave = (event) => { if (!event.relatedTarget) document.body.classList.remove("dropping"); };
document.ondrop = (event) => {
  event.preventDefault();
  document.body.classList.remove("dropping");
  takeFile(event.dataTransfer.files[0]);
};
get("said").onsubmit = (event) => { event.preventDefault(); if (table) take(table.name, table.bytes); };
get("sample").onclick = () => {
  // Two days of a room: temperature with the day, humidity against it, a door that opens.
  let noise = 12345, text = "time,temperature [degC],humidity [%],door\n";
  const random = () => (noise = (1103515245 * noise + 12345) % 2147483648) / 2147483648 - 0.5;
  for (let i = 0; i < 2880; i++) {
    const day = Math.sin(2 * Math.PI * (i - 600) / 1440);
    const time = new Date(Date.UTC(2026, 0, 5) + 60_000 * i).toISOString().slice(0, 19);
    text += `${time}Z,${(20.5 + 1.8 * day + 0.1 * random()).toFixed(2)},${i % 97 === 5 ? "" : (44 - 5 * day + 0.6 * random()).toFixed(1)},${i % 480 < 9 ? "open" : "closed"}\n`;
  }
  take("room.csv", new TextEncoder().encode(text));
};
get("share").oninput = () => { get("share-text").textContent = `${percent()} of each column's range`; pack(); };
function setOwn(text) {
  if (text === undefined) table.own.delete(drawn()); else table.own.set(drawn(), text);
  pack();
}
get("own").oninput = ({ target }) => {
  const { min, max } = table.columns[drawn()];
  setOwn(+target.value === 0 || !(max > min) ? "lossless" : `±${rounded(0.01 * shareOf(+target.value - 1) * (max - min))}`);
};
get("own-text").onchange = ({ target }) => setOwn(target.value.trim() || undefined);
get("own-none").onclick = () => setOwn();
get("drawn").onchange = get("thorough").onchange = pack;
function look(from, to) {
  const whole = [0, Math.max(1, table.rows - 1)], width = Math.min(to - from, whole[1]), start = Math.min(Math.max(from, 0), whole[1] - width);
  view = width >= whole[1] ? undefined : [start, start + Math.max(width, 4)];
  showTable();
}
const zoomed = (shift, factor) => () => {
  const [from, to] = view ?? [0, table.rows - 1], half = (to - from) / 2, middle = (from + to) / 2 + shift * half;
  look(middle - factor * half, middle + factor * half);
};
get("nearer").onclick = zoomed(0, .5);
get("farther").onclick = zoomed(0, 2);
get("left").onclick = zoomed(-1, 1);
get("right").onclick = zoomed(1, 1);
get("whole").onclick = () => { view = undefined; showTable(); };
get("table-plot").onpointerdown = (down) => {
  const svg = get("table-plot"), left = svg.getBoundingClientRect().left;
  svg.setPointerCapture(down.pointerId);
  svg.onpointerup = (up) => {
    svg.onpointerup = undefined;
    const ends = [down.clientX - left, up.clientX - left].map(table.scale.toX).sort((a, b) => a - b);
    if (Math.abs(up.clientX - down.clientX) > 5) look(...ends);
  };
};
const base = () => table.name.replace(/\.(gz|zst)$/, "").replace(/\.[^.]*$/, "");
get("download-fewb").onclick = async () => download(`${base()}.fewb`, "application/octet-stream", await ask("recording"));
get("download-csv").onclick = async () => download(`${base()}-restored.csv`, "text/csv", await ask("csv"));
get("verify").onclick = async () => {
  try {
    const verdict = await ask("verify");
    get("verdict").textContent = verdict.holds ? `all promises hold in ${verdict.rows} rows` : `the promises FAIL: ${verdict.failed.join(", ")}`;
  } catch (problem) {
    get("verdict").textContent = problem.message;
  }
};

// One bit.
const SLIDERS = [
  ["memory", "memory of the process", 0, 0.999, 0.001, 0.95],
  ["ratio", "process variance over noise variance", -3, 1, 0.05, -0.7, (v) => 10 ** v],
  ["flips", "share of inverted bits", 0, 0.45, 0.01, 0],
  ["loss", "share of lost bits", 0, 0.9, 0.01, 0],
  ["sensors", "sensors", 1, 16, 1, 1],
  ["slots", "slots", 50, 1000, 50, 200],
  ["seed", "seed", 1, 99, 1, 7],
];
get("bit-controls").innerHTML = SLIDERS.map(([name, label, min, max, step, value]) =>
  `<label>${label} <output></output> <input type="range" name="${name}" min="${min}" max="${max}" step="${step}" value="${value}"></label>`).join("");
let bitRuns = 0;
const showBit = latest(async () => {
  const setting = {};
  for (const [name, , , , , , shape] of SLIDERS) {
    const input = get("bit-controls").querySelector(`[name=${name}]`);
    setting[name] = (shape ?? Number)(+input.value);
    input.previousElementSibling.textContent = +setting[name].toPrecision(3);
    if (shape) input.setAttribute("aria-valuetext", setting[name].toPrecision(3));
  }
  let found;
  try {
    found = await ask("bit", setting);
    get("bit-problem").textContent = "";
  } catch (problem) {
    get("bit-problem").textContent = problem.message;
    return;
  }
  const x = Float64Array.from(found.truth, (_, i) => i);
  const fallen = (X, Y) => Array.from(x, (t) => {
    const bit = found.bits[t * setting.sensors], at = X(t), y = Y(found.threshold[t]);
    return bit === 0 ? "" : `<line class="bit${bit > 0 ? 1 : 0}" x1="${at}" x2="${at}" y1="${y}" y2="${y + (bit > 0 ? -9 : 9)}"/>`;
  }).join("");
  draw(get("bit-plot"), {
    series: [
      { kind: "band", x, low: found.mean.map((m, i) => m - 2 * found.deviation[i]), high: found.mean.map((m, i) => m + 2 * found.deviation[i]), label: "± 2 deviations" },
      { x, y: found.truth, style: "ink", label: "process" },
      { x, y: found.mean, style: "one", label: "from bits" },
      { x, y: found.kalman, style: "two", label: "Kalman" },
    ],
    xLabel: "slot", yLabel: "state", extra: setting.slots <= 400 ? fallen : undefined,
  });
  const exact = (value) => Number.isFinite(value) ? value.toFixed(4) : "not known in closed form", ratio = found.exact / found.exactKalman;
  get("bit-numbers").textContent = `Mean squared error in this run: ${found.mse.toFixed(4)} from bits, ${found.kalmanMse.toFixed(4)} of the Kalman filter. ` +
    `In the long run: ${exact(found.exact)} and ${exact(found.exactKalman)}` + (Number.isFinite(ratio) ? `; one bit in place of each sample costs ${(100 * (ratio - 1)).toFixed(1)} %.` : ".");
  get("bit-rust").textContent = rustOf(setting);
  get("bit-python").textContent = pythonOf(setting);
  document.body.dataset.bit = ++bitRuns;
});
const priorOf = ({ memory, ratio }) => memory < 1 ? ratio / (1 - memory * memory) : 1;
function rustOf(setting) {
  const link = setting.loss || setting.flips ? `.with_link(Link::new(${decimal(setting.loss)}, ${decimal(setting.flips)})?)` : "", several = setting.sensors > 1;
  const step = (pad, sample) => `${pad}let bit = Sign::of(${sample}, filter.feedback(&belief))?; // at the sensor
${pad}belief = filter.update(&belief, &Observation::Received(bit))?.0; // Observation::Nothing if it was lost`;
  return `use fewbits::core::{Gaussian, ${link ? "Link, " : ""}Observation, Sign};
use fewbits::dymbo::{DymboFilter, ScalarFilter, ScalarPlant};

// Noise variance 1. ${several ? `\`slots\`: ${setting.sensors} samples each.` : "`samples`: one per slot."}
let filter = DymboFilter::new(ScalarPlant::new(${decimal(setting.memory)}, ${decimal(setting.ratio)}, 1.0)?)${link};
let mut belief = Gaussian::scalar(0.0, ${decimal(priorOf(setting))})?;
for ${several ? "samples in slots" : "sample in samples"} {
    belief = filter.predict(&belief);
${several ? `    for sample in samples {\n${step("        ", "sample")}\n    }` : step("    ", "sample")}
}`;
}
const decimal = (value) => { const text = `${+value.toPrecision(6)}`; return /^-?\d+$/.test(text) ? `${text}.0` : text; };
function pythonOf(setting) {
  if (setting.sensors > 1 || setting.loss) return "# The Python class takes one sensor whose bits all arrive: set sensors to 1 and lost bits to 0.";
  return `import fewbits as fb

run = fb.OneBit(a=${decimal(setting.memory)}, process=${decimal(setting.ratio)}, noise=1.0, flips=${decimal(setting.flips)}).run(samples, mean=0.0, variance=${decimal(priorOf(setting))})
run.mean, run.variance, run.bits`;
}
get("bit-controls").oninput = showBit;
for (const button of document.querySelectorAll(".copy")) {
  button.onclick = async () => {
    const text = get(button.dataset.copy);
    try {
      await navigator.clipboard.writeText(text.textContent);
      get("copied").textContent = "copied";
    } catch {
      getSelection().selectAllChildren(text);
      get("copied").textContent = document.execCommand("copy") ? "copied" : "selected: copy it with the keyboard";
    }
  };
}

// Design.
let designed, designs = 0;
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);
get("design-form").onsubmit = async (event) => {
  event.preventDefault();
  const form = new FormData(event.target), number = (name) => Number(form.get(name));
  const setting = { mean: number("mean"), deviation: number("deviation"), noise: numbers(form.get("noise")), bits: numbers(form.get("bits")),
    flips: number("flips"), loss: number("loss"), criterion: form.get("criterion") };
  get("design-problem").textContent = "";
  get("design-state").textContent = "designing, at most some 20 seconds …";
  try {
    if ([...setting.noise, ...setting.bits].some((n) => !Number.isFinite(n))) throw new Error("noises and bits are numbers with commas between them, as `1, 1.5`");
    if (setting.bits.some((n) => !Number.isInteger(n) || n < 0)) throw new Error("bits are whole numbers");
    designed = { ...await ask("design", setting), setting };
    showDesign();
  } catch (problem) {
    get("design-problem").textContent = problem.message;
    get("design-state").textContent = "";
    get("design-found").hidden = true;
    designed = undefined;
  }
  document.body.dataset.designed = ++designs;
};
function showDesign() {
  if (!designed) return;
  const { setting } = designed, error = setting.criterion === "error";
  get("design-state").textContent = `${error ? "mean squared error" : "information / nat"} ${designed.value.toPrecision(6)}` +
    (designed.bound === null ? "" : `; no design can be ${error ? "below" : "above"} ${designed.bound.toPrecision(6)}`);
  get("design-found").hidden = false;
  get("cells").tBodies[0].innerHTML = designed.cells.map((cell) => `<tr><th scope="row">${cell.sensor + 1}</th><td>${cell.lower === null ? "−∞" : short(cell.lower)}</td><td>${cell.upper === null ? "∞" : short(cell.upper)}</td><td>${cell.word}</td></tr>`).join("");
  const spread = setting.noise.map((noise) => Math.hypot(setting.deviation, noise)), reach = 3.2 * Math.max(...spread), count = setting.noise.length;
  const x = Float64Array.from({ length: 400 }, (_, i) => setting.mean - reach + 2 * reach * i / 399);
  const density = x.map((v) => count + 0.9 * Math.exp(-0.5 * ((v - setting.mean) / setting.deviation) ** 2));
  draw(get("design-plot"), {
    series: [{ x, y: density, style: "one", label: "density of the unknown" }], xRange: [x[0], x[399]], yRange: [0, count + 1],
    xLabel: "measurement", yLabel: "sensor", yTicks: setting.noise.map((_, n) => [count - n - 0.5, `${n + 1}`]),
    extra: (X, Y) => designed.cells.map((cell) => {
      const from = X(cell.lower ?? x[0]), to = X(cell.upper ?? x[399]), top = Y(count - cell.sensor - 0.1), bottom = Y(count - cell.sensor - 0.9);
      return `<rect class="chosen" x="${from}" width="${Math.max(0, to - from)}" y="${top}" height="${bottom - top}"/>` +
        (to - from > 14 ? `<text class="word" x="${(from + to) / 2}" y="${(top + bottom) / 2 + 5}" text-anchor="middle">${cell.word}</text>` : "");
    }).join(""),
  });
}
get("download-header").onclick = () => download("quantizers.h", "text/x-c", designed.header);

// Which scheme.
function showFrontier() {
  const price = get("price").value, label = get("price").selectedOptions[0].textContent;
  const x = FRONTIER.map((one) => Math.log10(one[price])), y = FRONTIER.map((one) => one.rmse);
  const best = (one) => !FRONTIER.some((other) => other !== one && other.rmse <= one.rmse && other[price] <= one[price]);
  const said = (one) => `${one.scheme}: RMSE ${one.rmse.toFixed(3)}, ${label.replace(" / ", " ")} ${short(one[price])}`;
  const [from, to] = extent([x]), nice = [1, 2, 5].flatMap((m) => [-2, -1, 0, 1, 2, 3, 4].map((e) => Math.log10(m) + e)).sort((a, b) => a - b).filter((t) => t >= from && t <= to);
  const spread = get("frontier-plot").clientWidth < 500 && nice.length > 6 ? nice.filter((t) => Math.abs(t - Math.round(t)) < 1e-9) : nice;
  draw(get("frontier-plot"), {
    series: [{ x: Float64Array.from(x), y: Float64Array.from(y), style: "none" }], xRange: [from, to], yRange: extent([y]), xLabel: label, yLabel: "RMSE", xTicks: spread, xText: (t) => short(10 ** t),
    extra: (X, Y) => FRONTIER.map((one, i) => `<circle class="dot${best(one) ? " best" : ""}" tabindex="0" role="img" aria-label="${escaped(said(one))}" data-scheme="${i}" cx="${X(x[i])}" cy="${Y(y[i])}" r="7"><title>${escaped(said(one))}</title></circle>`).join(""),
  });
  for (const dot of get("frontier-plot").querySelectorAll(".dot")) {
    dot.onpointerenter = dot.onfocus = dot.onclick = () => { get("frontier-name").textContent = said(FRONTIER[dot.dataset.scheme]); };
  }
  get("schemes").tBodies[0].innerHTML = FRONTIER.map((one) => `<tr><th scope="row" title="${escaped(one.scheme)}">${escaped(one.scheme)}</th><td>${one.rmse.toFixed(3)}</td><td>${short(one.payload)}</td><td>${short(one.air)}</td><td>${short(one.energy)}</td></tr>`).join("");
}
get("price").onchange = showFrontier;
onresize = () => choose(tabs.find((tab) => tab.getAttribute("aria-selected") === "true"));
document.body.dataset.loaded = 1;
