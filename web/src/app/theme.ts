import { createTheme, Tooltip } from "@mantine/core";

export const theme = createTheme({
  primaryColor: "cyan",
  fontFamily: "Inter, system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif",
  fontFamilyMonospace: "ui-monospace, 'JetBrains Mono', Menlo, Consolas, monospace",
  defaultRadius: "md",
  cursorType: "pointer",
  components: {
    // A pointer that passes over a button shows nothing over what lies behind it.
    Tooltip: Tooltip.extend({ defaultProps: { openDelay: 500 } }),
  },
});
