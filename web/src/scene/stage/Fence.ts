/** Reports when WebGL has drawn what it was given, without waiting for it. */
export class Fence {
  private sync: WebGLSync | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {}

  /** Watch what has been given until now. */
  set(): void {
    this.dispose();
    this.sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
  }

  /** Whether that is drawn. */
  isPassed(): boolean {
    const { gl, sync } = this;
    return sync === null || gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED;
  }

  dispose(): void {
    this.gl.deleteSync(this.sync);
    this.sync = null;
  }
}
