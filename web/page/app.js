const get = (id) => document.getElementById(id);
const worker = new Worker(URL.createObjectURL(new Blob([get("worker").textContent], { type: "text/javascript" })));
worker.postMessage({ module: MODULE });

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
worker.onerror = (error) => { problem(error.message); };

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
    dialect[name] = value === "on" ? true : ["missing", "time-column", "words"].includes(name) ? names(value) : /^skip/.test(name) ? +value : value;
  }
  return { dialect, without: names(form.get("without")), tolerance: +form.get("tolerance"), numbered: form.get("tolerance") === "" };
}

// What a value of an option may be, where a message of the library gives one.
const VALUES = { decimal: /^[.,]$/, thousands: /^.$/, quote: /^.?$/, comment: /^\S{0,2}$/, delimiter: /^(.|tab)$/, skip: /^\d+$/, encoding: /^\w[\w-]+$/,
  "time-format": /^(?!and$|or$|if$|says$)[a-z]+$/, "time-zone": /^[+-]\d/ };
// The options that a message speaks of as buttons: those with a value read the table again, one without leads to its field.
function offers(message) {
  const form = get("said"), all = [];
  let end = -2;
  for (const found of message.matchAll(/--([a-z][a-z-]*[a-z])(?: ('[^']*'|[^\s();]+))?/g)) {
    const [, name, given] = found, field = form.elements[name];
    if (!field) continue;
    let value = given?.replace(/^'(.*)'$/, "$1").replace(/(.)[,:]$/, "$1"), text = `--${name}`;
    if (field.type === "checkbox") value = true;
    else if (value !== undefined && VALUES[name]?.test(value)) text += ` ${given.replace(/(.)[,:]$/, "$1")}`;
    else value = undefined;
    if (value !== undefined && found.index === end + 1) {
      all.at(-1).text += ` ${text}`;
      all.at(-1).sets.push([field, value]);
    } else if (!all.some((offer) => offer.text === text)) all.push({ text, sets: value === undefined ? [] : [[field, value]], field });
    end = value === undefined ? -2 : found.index + (field.type === "checkbox" ? name.length + 2 : found[0].length);
  }
  const buttons = all.map(({ text, sets, field }) => {
    const button = document.createElement("button");
    button.textContent = sets.length ? `read again with ${text}` : `to ${text}`;
    button.onclick = () => {
      get("reading").open = true;
      if (!sets.length) { field.focus(); return; }
      for (const [field, value] of sets) field.type === "checkbox" ? field.checked = value : field.value = value;
      form.requestSubmit();
    };
    return button;
  });
  if (Object.values(said().dialect).length || said().without.length) {
    const button = Object.assign(document.createElement("button"), { textContent: "read again without the options below" });
    button.onclick = () => { form.reset(); form.requestSubmit(); };
    buttons.push(button);
  }
  return buttons;
}
function problem(text) {
  get("table-problem").textContent = text.length > 1000 ? `${text.slice(0, 1000)} …` : text;
  get("offers").replaceChildren(...(text && table?.failed ? offers(text) : []));
}

async function take(name, bytes) {
  problem("");
  get("table-state").textContent = `reading ${name} …`;
  const kept = { name, bytes, own: new Map(), said: said() };
  table = view = values = planned = undefined;
  try {
    table = { ...kept, ...await ask("open", { bytes, said: JSON.stringify(kept.said) }) };
  } catch (error) {
    table = { ...kept, failed: true };
    get("table-found").hidden = true;
    get("table-state").textContent = "";
    problem(`${name}: ${error.message}`);
    get("reading").open = true;
    document.body.dataset.packed = "failed";
    return;
  }
  get("table-state").textContent = `${name}: packing ${table.rows} rows of ${table.columns.length} columns …`;
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
    problem("");
    showTable();
    const plan = await ask("plan", { column: values.column });
    if (now !== table) return;
    planned = { ...plan, column: values.column };
    showPlan();
  } catch (error) {
    if (now !== table) return;
    if (!now.packed) {
      get("table-state").textContent = "";
      get("table-found").hidden = true;
    }
    problem(now.packed ? error.message : `${now.name}: ${error.message}`);
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
  const headline = document.createElement("strong"), read = document.createElement("span");
  headline.textContent = `${table.name}: ${table.rows} rows, ${table.columns.length} columns. ${size} bytes become ${packed.bytes} (${+(100 * packed.bytes / size).toPrecision(3)} %). `;
  read.className = "hint";
  read.textContent = (time ? `Time ${time.columns.join(", ")} in ${time.scale}${time.from && `, ${time.from} to ${time.to}`}. ` : "Rows are numbered. ") +
    `Read as ${[table.format, table.dialect].filter(Boolean).join(", ")}`;
  get("table-state").replaceChildren(headline, read);
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
  const here = delta > 0 ? [Math.log10(delta)] : [], low = Math.min(x[0], ...here) - .1, high = Math.max(x.at(-1), ...here) + .1;
  draw(svg, {
    series: [{ x, y: Float64Array.from(points, (point) => point[2]), style: "one", label: `lossless: ${planned.lossless_bits.toFixed(2)} bit/sample` }],
    xLabel: `bound${column.unit && !column.words ? ` / ${column.unit}` : ""}`, yLabel: "bit/sample", xRange: [low, high], yRange: [0, 1.1 * Math.max(points[0][2], delta > 0 ? bits : 0, .1)],
    xTicks: Array.from({ length: Math.floor(high) - Math.ceil(low) + 1 }, (_, i) => Math.ceil(low) + i), xText: (t) => short(10 ** t),
    extra: (X, Y) => delta > 0 ? `<circle class="mark" cx="${X(Math.log10(delta))}" cy="${Y(bits)}" r="5"><title>now: ±${short(delta)}, ${bits.toFixed(3)} bits</title></circle>` : "",
  });
}

async function takeFile(file) {
  if (!file) return;
  choose(get("tab-table"));
  // What was said of a table holds for it: the next file begins without, unless something was said since.
  if (table && JSON.stringify(table.said) === JSON.stringify(said())) get("said").reset();
  try {
    await take(file.name, new Uint8Array(await file.arrayBuffer()));
  } catch (error) {
    get("table-state").textContent = "";
    problem(`${file.name} cannot be read: ${error.message}`);
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
