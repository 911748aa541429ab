/** TensorBoard inside the page. */

/** A relative address, so that it holds below any prefix; the parameter lets it read by GET only. */
export const ADDRESS = "./tensorboard/?tensorboardColab=true";

export const ID = "tensorboard";

/** The panels that the server offers: TensorBoard only if it runs there. */
export function offeredPanels<Panel extends { id: string }>(
  panels: readonly Panel[],
  server: { tensorboard?: boolean } | null,
): Panel[] {
  return panels.filter(({ id }) => id !== ID || server?.tensorboard === true);
}
