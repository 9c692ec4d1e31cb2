// Prints the sums of the first COUNT messages of every scheme: node sums.mjs MODULE COUNT [ADAPTIVE_COUNT].
import { readFile } from "node:fs/promises";

const [module, count, adaptive = count] = process.argv.slice(2);
const names = ["sign-bit", "sign-bit-codes", "innovation-word", "innovation-word-codes", "quantizer-word", "quantizer-word-codes",
  "pattern-bit", "range-level", "censoring", "censoring-codes", "censoring-told", "censoring-own", "trigger", "adaptive",
  "adaptive-circle", "range-level-codes"];
const { instance } = await WebAssembly.instantiate(await readFile(module));
names.forEach((name, place) => {
  const sum = BigInt.asUintN(64, instance.exports.sum(place, Number(name.startsWith("adaptive") ? adaptive : count)));
  console.log(name, sum.toString(16).padStart(16, "0"));
});
