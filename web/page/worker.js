// Calls the module: one message a question, one message an answer with the same number.
let ready, opened, recording;
const answers = {
  async open({ bytes, said }) {
    recording = undefined;
    opened?.free();
    opened = undefined;
    const isParquet = typeof parquet !== "undefined" && [...bytes.subarray(0, 4)].join() === "80,65,82,49";
    const isZstd = typeof parquet !== "undefined" && [...bytes.subarray(0, 4)].join() === "40,181,47,253";
    const rows = isParquet ? await ofParquet(bytes) : isZstd ? ofZstd(bytes) : bytes;
    opened = wasm_bindgen.Opened.read(rows, said);
    const found = JSON.parse(opened.summary());
    return isParquet ? { ...found, format: "Parquet", dialect: "", options: "" } : found;
  },
  pack({ bound, effort, identity = crypto.getRandomValues(new Uint32Array(1))[0] }) {
    const began = performance.now();
    recording = opened.pack(bound, wasm_bindgen.Effort[effort], identity);
    const seconds = 1e-3 * (performance.now() - began);
    return { bytes: recording.length, columns: JSON.parse(opened.cost(bound, wasm_bindgen.Effort[effort])), seconds };
  },
  values({ column }) { return { original: opened.values(column), restored: opened.restored(recording, column) }; },
  plan({ column }) { return JSON.parse(opened.plan(column))[0]; },
  recording() { return recording; },
  csv() { return opened.to_csv(recording); },
  verify() { return JSON.parse(opened.verify(recording)); },
  bit(setting) {
    const run = wasm_bindgen.one_bit(setting.memory, setting.ratio, setting.flips, setting.loss, setting.sensors, setting.slots, BigInt(setting.seed));
    const found = { truth: run.truth, mean: run.mean, deviation: run.deviation, kalman: run.kalman, threshold: run.threshold, bits: run.bits,
      mse: run.mse, kalmanMse: run.kalman_mse, exact: run.exact, exactKalman: run.exact_kalman };
    run.free();
    return found;
  },
  design(setting) { return JSON.parse(wasm_bindgen.design(JSON.stringify(setting))); },
};
function ofZstd(bytes) {
  try {
    return parquet.unzstd(bytes);
  } catch (problem) {
    throw `the file is packed by zstd and damaged: ${problem.message ?? problem}`;
  }
}
async function ofParquet(bytes) {
  try {
    return await parquet.toCsv(bytes, wasm_bindgen.gunzip);
  } catch (problem) {
    throw `the Parquet file is damaged or of a kind that cannot be read: ${problem.message ?? problem}`;
  }
}
onmessage = async ({ data: { id, question, given, module } }) => {
  if (module) {
    const text = atob(module), packed = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
    ready = wasm_bindgen({ module_or_path: unpack(packed) });
    return;
  }
  try {
    await ready; // a message may come before the module is compiled
    postMessage({ id, answer: await answers[question](given) });
  } catch (problem) {
    postMessage({ id, problem: typeof problem === "string" ? problem : `the page failed (${problem}): please report the table with which it did` });
  }
};
