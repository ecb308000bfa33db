// Actions on an alarm: the buttons for its state, and the small form that they open.
import { useState } from "preact/hooks";
import { ActionForm } from "./action_form";
import type { Alarm } from "./ask";
import { refresh } from "./live";
import { AlarmWords } from "./alarm_words";
import { arrow } from "./marks";
import { causeName } from "./sentences";
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
  const possible = alarm.recorded ? (Object.keys(STATES) as Action[]) : (["acknowledge"] as const);
  const fitting = possible.filter((action) => STATES[action]?.includes(alarm.state) ?? true);
  const title = <><bdi>{alarm.axis}</bdi> <bdi>{causeName(alarm.parameter)}</bdi> {arrow(alarm.direction)} {t.direction[alarm.direction]}</>;
  return (
    <span class="actions">
      {fitting.map((action) => (
        <button key={action} type="button" aria-label={t.actions.ofAlarm(t.actions[action], id)} onClick={() => open(action)}>
          {t.actions[action]}
        </button>
      ))}
      {opened && (
        <ActionForm key={opened} label={t.actions[opened]} title={title} either={opened === "comment"} path={`/api/v1/alarms/${id}/${opened}`}
          close={() => open((now) => (now === opened ? null : now))}
          body={(given) => (opened === "shelve" ? { duration_s: Number(given.get("duration")) } : {})}
          done={() => Promise.all([done(), refresh()])}>
          <p class="quiet"><AlarmWords alarm={alarm} /></p>
          {opened === "shelve" && (
            <label>{t.hideFor}
              <select name="duration">
                {t.durations.map(([s, words]) => <option key={s} value={s} selected={s === 28800}>{words}</option>)}
              </select>
            </label>
          )}
        </ActionForm>
      )}
    </span>
  );
}
