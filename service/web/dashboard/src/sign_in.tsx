// The form for the token of the daemon.
import { keepToken } from "./ask";
import { t } from "./texts";

export function SignIn({ why }: { why: string }) {
  const use = (event: SubmitEvent): void => {
    event.preventDefault();
    keepToken(String(new FormData(event.currentTarget as HTMLFormElement).get("token")));
    location.reload();
  };
  return (
    <form id="sign-in" class="banner note" onSubmit={use}>
      <p role="status"><bdi>{why}</bdi></p>
      <label for="token">{t.token}</label>
      <input id="token" name="token" type="password" autocomplete="off" required pattern="[A-Za-z0-9_\-]+" autofocus />
      <button>{t.useToken}</button>
    </form>
  );
}
