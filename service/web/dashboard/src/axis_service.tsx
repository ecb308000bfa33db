// Whether an axis is out of service: since when, by whom and why, and the buttons that change it.
import { useState } from "preact/hooks";
import { ActionForm } from "./action_form";
import type { Axis } from "./ask";
import { refresh } from "./live";
import { Time } from "./marks";
import { listed, noteText, whoName } from "./sentences";
import { t } from "./texts";

export function AxisService({ axis }: { axis: Axis }) {
  const [opened, open] = useState(false);
  const out = axis.out_of_service;
  const [action, label] = out === null ? ["out-of-service", t.service.remove] as const : ["return-to-service", t.service.giveBack] as const;
  const button = <button type="button" onClick={() => open(true)}>{label}</button>;
  return (
    <section class="axis-service" aria-label={t.service.title}>
      {out === null ? <p>{button}</p> : (
        <p class="banner warn">
          <b>{t.service.out}</b> {out.since !== null && <>{t.since} <Time at={out.since} /></>} (<bdi>{listed(whoName(out.who), noteText(out))}</bdi>). {t.service.meaning}
          {out.since !== null && <> {button}</>}
        </p>
      )}
      {opened && (
        <ActionForm label={label} title={<bdi>{axis.id}</bdi>} path={`/api/v1/axes/${encodeURIComponent(axis.id)}/${action}`}
          required={out === null} close={() => open(false)} done={refresh}>
          <p>{out === null ? t.service.meaning : t.service.after}</p>
        </ActionForm>
      )}
    </section>
  );
}
