// Parquet as CSV text, which the module reads as any other table. `pack` bundles this with hyparquet and fzstd, if they are installed.
import { parquetMetadata, parquetRead, parquetSchema } from "hyparquet";
import { decompress } from "fzstd";

const DAY = 86_400_000;
// Ticks of `10^-decimals` seconds since 1970, without rounding.
function stamp(ticks, decimals) {
  const unit = 10n ** BigInt(decimals), all = BigInt(ticks), rest = ((all % unit) + unit) % unit;
  const second = new Date(1000 * Number((all - rest) / unit)).toISOString().replace(/\.000Z$/, "");
  return rest === 0n ? second : `${second}.${String(rest).padStart(decimals, "0").replace(/0+$/, "")}`;
}
const parsers = {
  timestampFromMilliseconds: (ticks) => ticks === undefined || ticks === null ? ticks : stamp(ticks, 3),
  timestampFromMicroseconds: (ticks) => ticks === undefined || ticks === null ? ticks : stamp(ticks, 6),
  timestampFromNanoseconds: (ticks) => ticks === undefined || ticks === null ? ticks : stamp(ticks, 9),
  dateFromDays: (days) => days === undefined || days === null ? days : new Date(days * DAY).toISOString().slice(0, 10),
};
const quoted = (text) => /[",\n\r]|^\s|\s$/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
function cell(value, { zone, scale }) {
  if (value === null || value === undefined) return "";
  if (typeof value === "string") return quoted(value + zone);
  if (scale !== undefined) return value.toFixed(scale);
  if (typeof value === "object") return quoted(JSON.stringify(value, (_, part) => typeof part === "bigint" ? String(part) : part) ?? "");
  return Object.is(value, -0) ? "-0" : String(value).replace("Infinity", "inf");
}
const isUtc = ({ logical_type: logical, converted_type: converted }) =>
  logical?.type === "TIMESTAMP" ? logical.isAdjustedToUTC : /^TIMESTAMP/.test(converted ?? "");

// The bytes of a file that zstd packed.
export const unzstd = (bytes) => decompress(bytes);

// The bytes of a CSV file. `gunzip` unpacks columns that are packed by gzip.
export async function toCsv(bytes, gunzip) {
  const file = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), metadata = parquetMetadata(file);
  const columns = parquetSchema(metadata).children, names = columns.map(({ element }) => element.name);
  const kinds = columns.map(({ element }) => ({ zone: isUtc(element) ? "Z" : "", scale: element.converted_type === "DECIMAL" ? element.scale ?? 0 : undefined }));
  const parts = [new TextEncoder().encode(`${names.map(quoted).join(",")}\n`)], encoder = new TextEncoder();
  let start = 0;
  // One group of rows after the other: what is in memory is one group and the text.
  for (const { num_rows } of metadata.row_groups) {
    const end = start + Number(num_rows), cells = names.map(() => []);
    const onChunk = ({ columnName, columnData, rowStart }) => {
      const column = cells[names.indexOf(columnName)];
      for (let i = 0; i < columnData.length; i++) column[rowStart - start + i] = columnData[i];
    };
    await parquetRead({ file, metadata, rowStart: start, rowEnd: end, onChunk, parsers, compressors: { ZSTD: (packed) => decompress(packed), GZIP: (packed) => gunzip(packed) } });
    let text = "";
    for (let row = 0; row < end - start; row++) {
      text += `${cells.map((column, i) => cell(column[row], kinds[i])).join(",") || '""'}\n`;
      if (text.length > 1 << 20) { parts.push(encoder.encode(text)); text = ""; }
    }
    parts.push(encoder.encode(text));
    start = end;
  }
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) { all.set(part, at); at += part.length; }
  return all;
}
