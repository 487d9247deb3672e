import { defineConfig } from "vite";

// Addresses are relative: the service may stand behind a proxy, under any path.
export default defineConfig({
  base: "./",
  build: { target: "es2022", modulePreload: { polyfill: false }, assetsInlineLimit: 0, chunkSizeWarningLimit: 1600 },
  worker: { format: "es" },
});
