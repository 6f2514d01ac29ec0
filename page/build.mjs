// SPDX-License-Identifier: MIT
//
// node build.mjs KERNELS.wasm DATA.json PAGE.html: the page as one file, which asks no network for anything.
// DATA.json: what rigid_proto_ros/page/data.py writes.

import { build } from "esbuild";
import { readFile, readdir, writeFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";

const [kernels, data, page] = process.argv.slice(2);
const here = new URL(".", import.meta.url);
const beside = (name) => readFile(new URL(name, here), "utf8");

/** A part of the file that file.ts reads by its name: gzip in base64. memLevel: shorter blocks, each with a code of its
 * own, fit meshes, words and kernels better: 4 kB less than by the default. */
const part = (name, bytes) => `<script type="application/gzip" id="${name}">${gzipSync(bytes, { level: 9, memLevel: 6 }).toString("base64")}</script>`;

/** A text within <script> or <style>, which it must not end. */
const inside = (text, tag) => text.replaceAll(`</${tag}`, `<\\/${tag}`);

async function bundled(entry, options) {
  const made = await build({
    entryPoints: [new URL(entry, here).pathname],
    bundle: true,
    minify: true,
    write: false,
    charset: "utf8",
    legalComments: "none",
    target: ["chrome111", "firefox113", "safari16.4"],
    metafile: true,
    ...options,
  });
  return { text: made.outputFiles[0].text.trim(), inputs: Object.keys(made.metafile.inputs) };
}

/** The licences of the packages that these inputs are of. */
async function licences(inputs) {
  const found = inputs.map((path) => /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(path)?.[1]);
  const texts = [];
  for (const name of new Set(found.filter((each) => each !== undefined))) {
    const folder = new URL(`node_modules/${name}/`, here);
    const file = (await readdir(folder)).find((each) => /^licen[cs]e/i.test(each));
    const { version, license } = JSON.parse(await readFile(new URL("package.json", folder), "utf8"));
    const text = file === undefined ? license : await readFile(new URL(file, folder), "utf8");
    texts.push(`${name} ${version}\n\n${text.trim()}`);
  }
  return texts;
}

const script = await bundled("src/main.ts", { format: "esm", loader: { ".csv": "text" } });
const styles = await Promise.all(["src/style.css", "src/style_lesson.css"].map((file) => bundled(file, {})));
const own = (await beside("../LICENSE")).trim();
const texts = [`rigid_proto_ros\n\n${own}`, ...(await licences(script.inputs))];
const parts = [
  `<!--\n${texts.join("\n\n----\n\n").replaceAll("--", "- -")}\n-->`,
  part("kernels", await readFile(kernels)),
  part("data", await readFile(data)),
  '<script type="application/gzip" id="take"></script>',
];
const whole = (await beside("page.html"))
  .replace("/*STYLE*/", () => inside(styles.map(({ text }) => text).join(""), "style"))
  .replace("<!--DATA-->", () => parts.join("\n"))
  .replace("/*SCRIPT*/", () => inside(script.text, "script"));
await writeFile(page, whole);
