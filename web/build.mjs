// Builds page.html, or the file that is named: the template with style and program in it. Nothing is fetched.
import { build } from "esbuild";
import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";

const here = fileURLToPath(new URL(".", import.meta.url));
const bundle = async (entry, loader, define = {}) => {
  const { outputFiles } = await build({
    absWorkingDir: here, entryPoints: [entry], bundle: true, minify: true, write: false, target: "es2022", format: "iife",
    charset: "utf8", legalComments: "none", loader, define,
  });
  return outputFiles[0].text.trim();
};
const worker = await bundle("src/trainer_worker.ts", {});
const fluoroscope = await bundle("src/fluoroscope_worker.ts", {});
const program = await bundle("src/main.ts", { ".glsl": "text", ".frag": "text", ".vert": "text" }, { kWorker: JSON.stringify(worker), kFluoroscopeWorker: JSON.stringify(fluoroscope) });
const style = await bundle("src/page.css", {});
if (/<\/script|<!--|@xraycast-/i.test(program)) throw new Error("the program holds what ends a script element");
const template = await readFile(`${here}src/page.html`, "utf8");
const page = template.replace("@style@", () => style).replace("@program@", () => program);
await writeFile(process.argv[2] ?? `${here}page.html`, page);
