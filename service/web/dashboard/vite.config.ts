// Builds the page, which is that of / and of /docs, into service/web/static. `npm run dev` serves them with a daemon behind them.
import { defineConfig } from "vite";

const daemon = process.env.AXISWATCH_DAEMON ?? "http://127.0.0.1:8080";
const proxy = { target: daemon, changeOrigin: true, headers: { origin: daemon } };
const paths = ["/api", "/reports", "/openapi.json", "/metrics", "/healthz", "/readyz", "/static/icon-"];

export default defineConfig({
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
