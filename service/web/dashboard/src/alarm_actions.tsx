// What a person does about an alarm: the buttons that fit its state, and the small form that they open.
import { useEffect, useRef, useState } from "preact/hooks";
import { ask, isSilence, type Alarm } from "./ask";
import { refresh } from "./live";
import { arrow, Words } from "./marks";
import { t } from "./texts";

type Action = "acknowledge" | "shelve" | "unshelve" | "comment";

const STATES: Record<Action, string[] | null> = {
  acknowledge: ["unacknowledged", "returned", "latched"],
  shelve: ["unacknowledged", "acknowledged", "latched"],
  unshelve: ["shelved"],
  comment: null, // always
};

/** The buttons of an alarm; `done` is called when one of them has changed it. */
export function AlarmButtons({ alarm, done }: { alarm: Alarm; done: () => Promise<void> }) {
  const [opened, open] = useState<Action | null>(null);
  const { id } = alarm;
  if (id === null) return null;
  const fitting = (Object.keys(STATES) as Action[]).filter((action) => STATES[action]?.includes(alarm.state) ?? true);
  return (
    <span class="actions">
      {fitting.map((action) => (
        <button key={action} type="button" aria-label={t.actions.ofAlarm(t.actions[action], id)} onClick={() => open(action)}>
          {t.actions[action]}
        </button>
      ))}
      {opened && <ActionForm alarm={alarm} action={opened} close={() => open(null)} done={done} />}
    </span>
  );
}

interface FormProps {
  alarm: Alarm;
  action: Action;
  close: () => void;
  done: () => Promise<void>;
}

function ActionForm({ alarm, action, close, done }: FormProps) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [problem, setProblem] = useState("");
  const label = t.actions[action];
  useEffect(() => dialog.current?.showModal(), []);
  const send = async (event: SubmitEvent): Promise<void> => {
    event.preventDefault();
    const given = new FormData(event.currentTarget as HTMLFormElement);
    const body: Record<string, unknown> = { comment: given.get("comment"), work_order: given.get("order") };
    if (action === "shelve") body.duration_s = Number(given.get("duration"));
    try {
      await ask(`/api/v1/alarms/${alarm.id}/${action}`, body);
    } catch (error) {
      return setProblem(isSilence(error) ? t.noAnswer : (error as Error).message);
    }
    close();
    await Promise.all([done(), refresh()]);
  };
  return (
    <dialog ref={dialog} aria-labelledby="alarm-dialog-title" onClose={close}>
      <form onSubmit={send}>
        <h2 id="alarm-dialog-title">{label}: <bdi>{alarm.axis}</bdi> <bdi>{alarm.parameter}</bdi> {arrow(alarm.direction)} {t.direction[alarm.direction]}</h2>
        <p class="quiet"><Words>{alarm.words}</Words></p>
        {action === "shelve" && (
          <label>{t.hideFor}
            <select name="duration">
              {t.durations.map(([s, words]) => <option key={s} value={s} selected={s === 28800}>{words}</option>)}
            </select>
          </label>
        )}
        <label>{t.comment}<textarea name="comment" rows={2} maxLength={2000} /></label>
        <label>{t.workOrderLabel}<input name="order" maxLength={100} autocomplete="off" /></label>
        {problem && <p class="banner bad" role="alert">{problem}</p>}
        <div class="choices">
          <button type="button" onClick={close}>{t.actions.cancel}</button>
          <button type="submit">{label}</button>
        </div>
      </form>
    </dialog>
  );
}
