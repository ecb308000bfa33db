// Builds two pages, / and /docs, into service/web/static. `npm run dev` serves them with a daemon behind them.
import { readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";

const daemon = process.env.AXISWATCH_DAEMON ?? "http://127.0.0.1:8080";
const proxy = { target: daemon, changeOrigin: true, headers: { origin: daemon } };
const paths = ["/api", "/reports", "/openapi.json", "/metrics", "/healthz", "/readyz"];

/** The icon with a number: icon-1.svg to icon-9.svg, and icon-many.svg. A policy of the daemon forbids data: images. */
function numberedIcons(): Plugin {
  return {
    name: "numbered-icons",
    apply: "build",
    generateBundle() {
      const icon = readFileSync("public/icon.svg", "utf8").trim();
      for (const name of ["1", "2", "3", "4", "5", "6", "7", "8", "9", "many"]) {
        const text = name === "many" ? "9+" : name;
        const mark =
          '<circle cx="22" cy="10" r="10" fill="#c8102e"/>' +
          `<text x="22" y="15" font-family="sans-serif" font-size="14" font-weight="700" fill="#fff" text-anchor="middle">${text}</text>`;
        this.emitFile({ type: "asset", fileName: `icon-${name}.svg`, source: icon.replace("</svg>", `${mark}</svg>\n`) });
      }
    },
  };
}

export default defineConfig({
  base: "/static/",
  plugins: [numberedIcons()],
  build: {
    outDir: "../static",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rolldownOptions: {
      input: { page: "index.html", docs: "docs.html" },
      // Names stay the same from version to version: the daemon lets the browser ask each time.
      output: { entryFileNames: "[name].js", chunkFileNames: "[name].js", assetFileNames: "[name][extname]" },
    },
  },
  server: { proxy: Object.fromEntries(paths.map((path) => [path, proxy])) },
});
