/** Which name is in which cell of a texture with room for few of many names. */
export class NameCells {
  /** The longest unused one first. */
  private readonly cells = new Map<string, number>();

  constructor(private readonly capacity: number) {}

  /** Cell of a name that is held; -1: none. */
  cellOf(name: string): number {
    return this.cells.get(name) ?? -1;
  }

  /** Give each name a cell, `capacity` at most; those that are new, with the cell to write them to. */
  hold(names: readonly string[]): [string, number][] {
    for (const name of names) {
      const cell = this.cells.get(name);
      if (cell === undefined) continue;
      this.cells.delete(name);
      this.cells.set(name, cell);
    }
    return names
      .filter((name) => !this.cells.has(name))
      .map((name) => {
        const cell = this.free();
        this.cells.set(name, cell);
        return [name, cell];
      });
  }

  private free(): number {
    if (this.cells.size < this.capacity) return this.cells.size;
    const [oldest, cell] = this.cells.entries().next().value!;
    this.cells.delete(oldest);
    return cell;
  }
}
