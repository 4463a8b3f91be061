// Bundles each NAME.entry.js into static/vendor/NAME.js, with the licences of all that is in it beside it. The first line
// of a bundle names the digest of what it is made of: tests/web/test_vendored.py compares.

import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const HERE = dirname(fileURLToPath(import.meta.url));
const TO = process.argv[2] ?? join(HERE, "../../src/grader/web/static/vendor");
const ENTRY = ".entry.js";

const read = (name) => readFileSync(join(HERE, name));
const packageOf = (path) => /^node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1];
const licenceOf = (name) => {
  const folder = join(HERE, "node_modules", name);
  const { version } = JSON.parse(readFileSync(join(folder, "package.json")));
  const file = readdirSync(folder).find((one) => /^licen[cs]e/i.test(one));
  if (!file) throw new Error(`${name} has no licence`);
  return `${name} ${version}\n\n${readFileSync(join(folder, file), "utf8").trim()}\n`;
};

for (const entry of readdirSync(HERE).filter((name) => name.endsWith(ENTRY))) {
  const name = entry.slice(0, -ENTRY.length);
  const digest = createHash("sha256");
  for (const part of ["package-lock.json", "build.mjs", entry]) digest.update(read(part));
  const made = await build({
    absWorkingDir: HERE, entryPoints: [entry], bundle: true, format: "esm", minify: true, target: "es2022",
    legalComments: "none", charset: "utf8", write: false, metafile: true,
    banner: { js: `// Made by make vendor of ${digest.digest("hex")}; licences in ${name}.LICENSES.txt` },
  });
  const packages = new Set(Object.keys(made.metafile.inputs).map(packageOf).filter(Boolean));
  writeFileSync(join(TO, `${name}.js`), made.outputFiles[0].contents);
  writeFileSync(join(TO, `${name}.LICENSES.txt`), [...packages].sort().map(licenceOf).join(`\n${"-".repeat(72)}\n\n`));
}
