// The small form in which a person says why: what it is about, a comment, the number of a work order; and sends it.
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { ask, isSilence } from "./ask";
import { t } from "./texts";

interface Props {
  /** What is done, as on the button that sends it. */
  label: string;
  title: ComponentChildren;
  /** Where it is sent to, and what beside comment and work order. */
  path: string;
  body?: (given: FormData) => Record<string, unknown> | Promise<Record<string, unknown>>;
  required?: boolean;
  /** Fields before the comment, and a confirmation behind the work order. */
  children?: ComponentChildren;
  confirm?: string | undefined;
  close: () => void;
  done: () => Promise<unknown>;
}

export function ActionForm({ label, title, path, body, required = false, children, confirm, close, done }: Props) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => dialog.current?.showModal(), []);
  const send = async (event: SubmitEvent): Promise<void> => {
    event.preventDefault();
    const given = new FormData(event.currentTarget as HTMLFormElement);
    try {
      await ask(path, { comment: given.get("comment"), work_order: given.get("order"), ...(await body?.(given)) });
    } catch (error) {
      return setProblem(isSilence(error) ? t.noAnswer : (error as Error).message);
    }
    close();
    await done();
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
          <button type="button" onClick={close}>{t.actions.cancel}</button>
          <button type="submit">{label}</button>
        </div>
      </form>
    </dialog>
  );
}
