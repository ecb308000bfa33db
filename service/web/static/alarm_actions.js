// What a person does about an alarm: the buttons of its row, and the small form that they open.

import { el, text } from "./dom.js";
import { ask } from "./token.js";

const ACTIONS = {
  acknowledge: { label: "Acknowledge", states: ["unacknowledged", "returned", "latched"] },
  shelve: { label: "Shelve", states: ["unacknowledged", "acknowledged", "latched"] },
  unshelve: { label: "Unshelve", states: ["shelved"] },
};

const dialog = document.getElementById("alarm-dialog");
const form = dialog.querySelector("form");
const problem = dialog.querySelector("[role=alert]");
let opened = null; // the alarm and the action of the form
let done = () => {};

/** The buttons that fit the state of an alarm; `after` is called when one of them has changed it. */
export function buttons(alarm, after) {
  done = after;
  if (!alarm.recorded) return [];
  return Object.entries(ACTIONS)
    .filter(([, { states }]) => states.includes(alarm.state))
    .map(([action, { label }]) =>
      el("button", { type: "button", onclick: () => open(alarm, action), "aria-label": `${label} alarm ${alarm.id}` }, label),
    );
}

function open(alarm, action) {
  opened = { alarm, action };
  const { label } = ACTIONS[action];
  text(document.getElementById("alarm-dialog-title"), `${label}: ${alarm.axis} ${alarm.parameter} ${alarm.direction}`);
  text(document.getElementById("alarm-dialog-words"), alarm.words);
  text(form.querySelector("[type=submit]"), label);
  document.getElementById("alarm-shelf").hidden = action !== "shelve";
  problem.hidden = true;
  form.reset();
  dialog.showModal();
}

async function send() {
  const { alarm, action } = opened;
  const body = { comment: form.elements.comment.value, work_order: form.elements.order.value };
  if (action === "shelve") body.duration_s = Number(form.elements.duration.value);
  await ask(`/api/v1/alarms/${alarm.id}/${action}`, body);
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    await send();
    dialog.close();
    await done();
  } catch (error) {
    problem.hidden = false;
    text(problem, error instanceof TypeError || error.name === "TimeoutError" ? "No answer." : error.message);
  }
});
form.querySelector("[name=cancel]").addEventListener("click", () => dialog.close());
