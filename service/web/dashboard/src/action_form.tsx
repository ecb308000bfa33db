// The small form for the reason of an action: its subject, a comment, the number of a work order; it sends the action.
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { ask } from "./ask";
import { failure } from "./sentences";
import { t } from "./texts";

const AFTER_DRAWING_MS = 100;

interface Props {
  /** The action, as on the button that sends it. */
  label: string;
  title: ComponentChildren;
  /** Path of the request, and its content besides comment and work order. */
  path: string;
  body?: (given: FormData) => Record<string, unknown> | Promise<Record<string, unknown>>;
  required?: boolean;
  /** Comment or work order must be given. */
  either?: boolean;
  /** Fields before the comment, and a confirmation after the work order. */
  children?: ComponentChildren;
  confirm?: string | undefined;
  /** Called a moment after the dialog has closed: by then another form may be open, which must stay. */
  close: () => void;
  done: () => Promise<unknown>;
}

export function ActionForm({ label, title, path, body, required = false, either = false, children, confirm, close, done }: Props) {
  const dialog = useRef<HTMLDialogElement>(null);
  const opener = useRef(document.activeElement);
  const sending = useRef(false);
  const [problem, setProblem] = useState("");
  useEffect(() => dialog.current?.showModal(), []);
  const send = async (event: SubmitEvent): Promise<void> => {
    event.preventDefault();
    const given = new FormData(event.currentTarget as HTMLFormElement);
    if (either && !given.get("comment") && !given.get("order")) return setProblem(t.giveEither);
    if (sending.current) return; // a double click
    sending.current = true;
    try {
      await ask(path, { comment: given.get("comment"), work_order: given.get("order"), ...(await body?.(given)) });
    } catch (error) {
      return setProblem(failure(error));
    } finally {
      sending.current = false;
    }
    const place = opener.current?.parentElement;
    dialog.current?.close();
    await done();
    // The pressed button may be gone: keyboard focus then moves to its neighbour, or to the content.
    setTimeout(() => {
      if (document.activeElement !== document.body) return;
      const next = place?.isConnected ? place.querySelector("button") : null;
      (next ?? document.getElementById("main"))?.focus();
    }, AFTER_DRAWING_MS);
  };
  return (
    <dialog ref={dialog} aria-labelledby="action-title" onClose={close}>
      <form onSubmit={send}>
        <h2 id="action-title">{label}: {title}</h2>
        {children}
        <label>{t.comment}<textarea name="comment" rows={2} maxLength={2000} required={required} /></label>
        <label>{t.workOrderLabel}<input name="order" maxLength={100} autocomplete="off" /></label>
        {confirm && <label class="confirm"><input type="checkbox" required /> {confirm}</label>}
        {problem && <p class="banner bad" role="alert">{problem}</p>}
        <div class="choices">
          <button type="button" onClick={() => dialog.current?.close()}>{t.actions.cancel}</button>
          <button type="submit">{label}</button>
        </div>
      </form>
    </dialog>
  );
}
