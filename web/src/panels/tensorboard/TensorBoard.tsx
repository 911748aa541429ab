import { ADDRESS } from "./tensorboard.ts";
import classes from "./TensorBoard.module.css";

/** The curves of trainings; the frame may not replace the page. */
export default function TensorBoard() {
  return (
    <iframe
      title="TensorBoard"
      src={ADDRESS}
      className={classes.frame}
      sandbox="allow-scripts allow-same-origin allow-downloads allow-popups"
    />
  );
}
