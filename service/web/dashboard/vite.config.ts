// Builds the page, which is that of / and of /docs, into service/web/static. `npm run dev` serves them with a daemon behind them.
import { defineConfig } from "vite";

const daemon = process.env.AXISWATCH_DAEMON ?? "http://127.0.0.1:8080";
const proxy = { target: daemon, changeOrigin: true, headers: { origin: daemon } };
const paths = ["/api", "/reports", "/openapi.json", "/metrics", "/healthz", "/readyz", "/static/icon-"];

// uPlot names all its kinds of lines, so that none is left out where it is not used: here all are straight.
const straightLines = {
  name: "straight-lines",
  transform: (code: string, id: string) => (id.includes("uplot") ? code.replace(/^\s*\(paths\.(stepped|bars|spline)\s.*$/gm, "") : null),
};

export default defineConfig({
  plugins: [straightLines],
  base: "/static/",
  build: {
    outDir: "../static",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    rolldownOptions: {
      input: { page: "index.html" },
      // Names stay the same from version to version: the daemon lets the browser ask each time.
      output: { entryFileNames: "[name].js", chunkFileNames: "[name].js", assetFileNames: "[name][extname]" },
    },
  },
  server: { proxy: Object.fromEntries(paths.map((path) => [path, proxy])) },
});
