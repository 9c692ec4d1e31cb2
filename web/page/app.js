const get = (id) => document.getElementById(id);
const worker = new Worker(URL.createObjectURL(new Blob([get("worker").textContent], { type: "text/javascript" })));
worker.postMessage({ module: Uint8Array.from(atob(MODULE), (c) => c.charCodeAt(0)) });

const waiting = new Map();
let questions = 0;
function ask(question, given = {}) {
  questions += 1;
  return new Promise((resolve, reject) => {
    waiting.set(questions, { resolve, reject });
    worker.postMessage({ id: questions, question, given });
  });
}
worker.onmessage = ({ data: { id, answer, problem } }) => {
  const { resolve, reject } = waiting.get(id);
  waiting.delete(id);
  problem === undefined ? resolve(answer) : reject(new Error(problem));
};
worker.onerror = (problem) => { get("table-problem").textContent = problem.message; };

function download(name, type, content) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

// Tabs, by pointer and by arrow keys.
const tabs = [...document.querySelectorAll("[role=tab]")];
function choose(tab) {
  for (const one of tabs) {
    const chosen = one === tab;
    one.setAttribute("aria-selected", chosen);
    one.tabIndex = chosen ? 0 : -1;
    get(one.getAttribute("aria-controls")).hidden = !chosen;
  }
  ({ "tab-bit": showBit, "tab-frontier": showFrontier, "tab-table": showTable, "tab-design": showDesign })[tab.id]?.();
}
for (const [i, tab] of tabs.entries()) {
  tab.onclick = () => choose(tab);
  tab.onkeydown = ({ key }) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[key];
    if (!step) return;
    const next = tabs[(i + step + tabs.length) % tabs.length];
    next.focus();
    choose(next);
  };
}

// A table of the user.
let table, values, view, packing = 0;
const shareOf = () => 0.001 * 10 ** (get("share").value / 15); // in per cent of the range: .001 to 10
const percent = (share) => `${+(share).toPrecision(2)}%`;

async function take(name, bytes) {
  get("table-problem").textContent = "";
  get("table-state").textContent = `reading ${name} …`;
  try {
    table = await ask("open", { name, bytes });
  } catch (problem) {
    table = undefined;
    get("table-found").hidden = true;
    get("table-state").textContent = "";
    get("table-problem").textContent = problem.message;
    return;
  }
  table.name = name;
  table.size = bytes.length;
  view = undefined;
  get("drawn").replaceChildren(...table.columns.map((column, i) => new Option(column.name, i)));
  get("table-found").hidden = false;
  await pack();
}

async function pack() {
  if (!table) return;
  const mine = ++packing, share = percent(shareOf());
  get("share-text").textContent = `${share} of the range`;
  get("verdict").textContent = "";
  try {
    const packed = await ask("pack", { bound: share });
    if (mine !== packing) return;
    table.packed = packed;
    values = await ask("values", { column: +get("drawn").value });
    if (mine === packing) showTable();
  } catch (problem) {
    get("table-problem").textContent = problem.message;
  }
  document.body.dataset.packed = mine;
}

function showTable() {
  if (!table?.packed) return;
  const { packed } = table;
  get("table-state").textContent = `${table.name}: ${table.rows} rows, ${table.columns.length} columns${table.time ? `, time ${table.time}` : ""}; ${table.dialect}. ` +
    `${table.size} bytes become ${packed.bytes} (${(100 * packed.bytes / table.size).toFixed(1)} %).`;
  get("columns").tBodies[0].innerHTML = table.columns.map((column, i) => {
    const cost = packed.columns[i];
    return `<tr><th scope="row">${escaped(column.name)}${column.unit ? ` / ${escaped(column.unit)}` : ""}</th><td>${column.samples}</td><td>${column.gaps}</td>
      <td>${column.min === null ? "" : short(column.min)}</td><td>${column.max === null ? "" : short(column.max)}</td><td>${escaped(cost.bound)}</td><td>${cost.bits.toFixed(3)}</td><td>${cost.bytes}</td></tr>`;
  }).join("");
  get("command").textContent = `fewbits pack ${table.name}${table.time ? " --time exact" : ""} --bound ${percent(shareOf())} -o out.fewb`;
  if (!values) return;
  const column = +get("drawn").value, delta = packed.columns[column].delta, x = Float64Array.from(values.original, (_, i) => i);
  const series = [
    { kind: "band", x, low: values.restored.map((v) => v - delta), high: values.restored.map((v) => v + delta), label: "restored ± bound" },
    { x, y: values.original, style: "ink", label: "original" },
    { x, y: values.restored, style: "one", label: "restored" },
  ];
  table.scale = draw(get("table-plot"), { series, xLabel: "row", yLabel: table.columns[column].name, xRange: view });
}

get("file").onchange = async ({ target }) => target.files[0] && take(target.files[0].name, new Uint8Array(await target.files[0].arrayBuffer()));
document.ondragover = (event) => event.preventDefault();
document.ondrop = async (event) => {
  event.preventDefault();
  const file = event.dataTransfer.files[0];
  choose(get("tab-table"));
  if (file) take(file.name, new Uint8Array(await file.arrayBuffer()));
};
get("sample").onclick = () => {
  // Two days of a room: temperature with the day, humidity against it, a door that opens.
  let noise = 12345, text = "time,temperature,humidity,door\n";
  const random = () => (noise = (1103515245 * noise + 12345) % 2147483648) / 2147483648 - 0.5;
  for (let i = 0; i < 2880; i++) {
    const day = Math.sin(2 * Math.PI * (i - 600) / 1440);
    const time = new Date(Date.UTC(2026, 0, 5) + 60_000 * i).toISOString().slice(0, 19);
    text += `${time}Z,${(20.5 + 1.8 * day + 0.1 * random()).toFixed(2)},${i % 97 === 5 ? "" : (44 - 5 * day + 0.6 * random()).toFixed(1)},${i % 480 < 9 ? 1 : 0}\n`;
  }
  take("room.csv", new TextEncoder().encode(text));
};
get("share").oninput = pack;
get("drawn").onchange = async () => {
  view = undefined;
  values = await ask("values", { column: +get("drawn").value });
  showTable();
};
get("whole").onclick = () => { view = undefined; showTable(); };
get("table-plot").onpointerdown = (down) => {
  const svg = get("table-plot"), left = svg.getBoundingClientRect().left;
  svg.onpointerup = (up) => {
    svg.onpointerup = undefined;
    const ends = [down.clientX - left, up.clientX - left].map(table.scale.toX).sort((a, b) => a - b);
    if (Math.abs(up.clientX - down.clientX) > 5) { view = ends; showTable(); }
  };
};
get("download-fewb").onclick = async () => download(`${table.name.replace(/\.[^.]*$/, "")}.fewb`, "application/octet-stream", await ask("recording"));
get("download-csv").onclick = async () => download(`${table.name.replace(/\.[^.]*$/, "")}-restored.csv`, "text/csv", await ask("csv"));
get("verify").onclick = async () => {
  const verdict = await ask("verify");
  get("verdict").textContent = verdict.holds ? `all promises hold in ${verdict.rows} rows` : `the promises FAIL: ${verdict.failed.join(", ")}`;
};

// One bit.
const SLIDERS = [
  ["memory", "memory of the process", 0, 0.999, 0.001, 0.95],
  ["ratio", "process variance over noise variance", -3, 1, 0.05, -0.7, (v) => 10 ** v],
  ["flips", "inverted bits", 0, 0.45, 0.01, 0],
  ["loss", "lost bits", 0, 0.9, 0.01, 0],
  ["sensors", "sensors", 1, 16, 1, 1],
  ["slots", "slots", 50, 1000, 50, 200],
  ["seed", "seed", 1, 99, 1, 7],
];
get("bit-controls").innerHTML = SLIDERS.map(([name, label, min, max, step, value]) =>
  `<label>${label} <input type="range" name="${name}" min="${min}" max="${max}" step="${step}" value="${value}"> <output>${value}</output></label>`).join("");
let bitRun = 0;
async function showBit() {
  const mine = ++bitRun, setting = {};
  for (const [name, , , , , , shape] of SLIDERS) {
    const input = get("bit-controls").querySelector(`[name=${name}]`);
    setting[name] = (shape ?? Number)(+input.value);
    input.nextElementSibling.textContent = +setting[name].toPrecision(3);
  }
  let found;
  try {
    found = await ask("bit", setting);
  } catch (problem) {
    get("bit-problem").textContent = problem.message;
    return;
  }
  if (mine !== bitRun) return;
  get("bit-problem").textContent = "";
  const x = Float64Array.from(found.truth, (_, i) => i);
  const fallen = (X, Y) => Array.from(x, (t) => {
    const bit = found.bits[t * setting.sensors], at = X(t), y = Y(found.threshold[t]);
    return bit === 0 ? "" : `<line class="bit${bit > 0 ? 1 : 0}" x1="${at}" x2="${at}" y1="${y}" y2="${y + (bit > 0 ? -7 : 7)}"/>`;
  }).join("");
  draw(get("bit-plot"), {
    series: [
      { kind: "band", x, low: found.mean.map((m, i) => m - 2 * found.deviation[i]), high: found.mean.map((m, i) => m + 2 * found.deviation[i]), label: "± 2 deviations" },
      { x, y: found.truth, style: "ink", label: "process" },
      { x, y: found.mean, style: "one", label: "from bits" },
      { x, y: found.kalman, style: "two", label: "Kalman" },
    ],
    xLabel: "slot", yLabel: "state", extra: setting.slots <= 400 ? fallen : "",
  });
  const exact = (value) => Number.isFinite(value) ? value.toFixed(4) : "not known in closed form";
  get("bit-numbers").textContent = `Mean squared error in this run: ${found.mse.toFixed(4)} from bits, ${found.kalmanMse.toFixed(4)} of the Kalman filter. ` +
    `In the long run: ${exact(found.exact)} and ${exact(found.exactKalman)}.`;
  const q = setting.ratio.toPrecision(4);
  get("bit-rust").textContent = `use fewbits::core::{Gaussian, Link, Observation, Sign};
use fewbits::dymbo::{DymboFilter, ScalarFilter, ScalarPlant};

let filter = DymboFilter::new(ScalarPlant::new(${setting.memory}, ${q}, 1.0)?).with_link(Link::new(${setting.loss}, ${setting.flips})?);
let mut belief = Gaussian::scalar(0.0, 1.0)?;
for sample in samples {
    belief = filter.predict(&belief);
    let bit = Sign::of(sample, filter.threshold(&belief))?;
    belief = filter.update(&belief, &Observation::Received(bit))?.0;
}`;
  get("bit-python").textContent = `import fewbits as fb

run = fb.OneBit(a=${setting.memory}, process=${q}, noise=1.0, flips=${setting.flips}).run(samples, mean=0.0, variance=1.0)
run.mean, run.variance, run.bits`;
  document.body.dataset.bit = mine;
}
get("bit-controls").oninput = showBit;
for (const button of document.querySelectorAll(".copy")) {
  button.onclick = () => navigator.clipboard?.writeText(get(button.dataset.copy).textContent);
}

// Design.
let designed;
const numbers = (text) => text.split(/[\s,;]+/).filter(Boolean).map(Number);
get("design-form").onsubmit = async (event) => {
  event.preventDefault();
  const form = new FormData(event.target);
  const setting = { mean: +form.get("mean"), deviation: +form.get("deviation"), noise: numbers(form.get("noise")), bits: numbers(form.get("bits")),
    flips: +form.get("flips"), loss: +form.get("loss"), criterion: form.get("criterion") };
  get("design-problem").textContent = "";
  get("design-state").textContent = "designing …";
  try {
    designed = { ...await ask("design", setting), setting };
    showDesign();
  } catch (problem) {
    get("design-problem").textContent = problem.message;
    get("design-state").textContent = "";
    get("design-found").hidden = true;
  }
  document.body.dataset.designed = questions;
};
function showDesign() {
  if (!designed) return;
  const { setting } = designed, error = setting.criterion === "error";
  get("design-state").textContent = `${error ? "mean squared error" : "information / nat"} ${designed.value.toPrecision(6)}` +
    (designed.bound === null ? "" : `; no design can be ${error ? "below" : "above"} ${designed.bound.toPrecision(6)}`);
  get("design-found").hidden = false;
  get("cells").tBodies[0].innerHTML = designed.cells.map((cell) => `<tr><th scope="row">${cell.sensor + 1}</th><td>${cell.lower === null ? "−∞" : short(cell.lower)}</td><td>${cell.upper === null ? "∞" : short(cell.upper)}</td><td>${cell.word}</td></tr>`).join("");
  const spread = setting.noise.map((noise) => Math.hypot(setting.deviation, noise)), reach = 3.2 * Math.max(...spread);
  const x = Float64Array.from({ length: 400 }, (_, i) => setting.mean - reach + 2 * reach * i / 399);
  const density = x.map((v) => Math.exp(-0.5 * ((v - setting.mean) / setting.deviation) ** 2));
  const count = setting.noise.length;
  draw(get("design-plot"), {
    series: [{ x, y: density.map((p) => count + p), style: "one", label: "prior" }, { x, y: x.map(() => 0), style: "grid" }],
    xLabel: "measurement", yLabel: "sensor",
    extra: (X, Y) => designed.cells.map((cell) => {
      const from = X(cell.lower ?? x[0]), to = X(cell.upper ?? x[399]), top = Y(count - cell.sensor - 0.1), bottom = Y(count - cell.sensor - 0.8);
      return `<rect class="chosen" x="${from}" width="${Math.max(0, to - from)}" y="${top}" height="${bottom - top}"/><text x="${(Math.max(from, X(x[0])) + Math.min(to, X(x[399]))) / 2}" y="${(top + bottom) / 2 + 5}" text-anchor="middle">${cell.word}</text>`;
    }).join(""),
  });
}
get("download-header").onclick = () => download("quantizers.h", "text/x-c", designed.header);

// Which scheme.
function showFrontier() {
  const price = get("price").value, label = get("price").selectedOptions[0].textContent;
  const x = FRONTIER.map((one) => Math.log10(one[price])), y = FRONTIER.map((one) => one.rmse);
  draw(get("frontier-plot"), {
    series: [{ x: Float64Array.from(x), y: Float64Array.from(y), style: "none" }], xLabel: `logarithm of ${label}`, yLabel: "RMSE",
    extra: (X, Y) => FRONTIER.map((one, i) => `<circle class="dot" tabindex="0" cx="${X(x[i])}" cy="${Y(y[i])}" r="6"><title>${escaped(one.scheme)}: RMSE ${one.rmse.toFixed(3)}, ${short(one[price])} ${escaped(label)}</title></circle>`).join(""),
  });
  get("schemes").tBodies[0].innerHTML = FRONTIER.map((one) => `<tr><th scope="row">${escaped(one.scheme)}</th><td>${one.rmse.toFixed(3)}</td><td>${short(one.payload)}</td><td>${short(one.air)}</td><td>${one.energy.toFixed(3)}</td></tr>`).join("");
}
get("price").onchange = showFrontier;
onresize = () => choose(tabs.find((tab) => tab.getAttribute("aria-selected") === "true"));
