// Password in, token out; the token then stands in the address like the printed one.

document.getElementById("login").addEventListener("submit", async (event) => {
  event.preventDefault();
  const body = JSON.stringify({ password: document.getElementById("password").value });
  const response = await fetch("/login", { method: "POST", body });
  const answer = await response.json();
  if (response.ok) location.replace(`/?token=${encodeURIComponent(answer.token)}`);
  else document.getElementById("fault").textContent = answer.error;
});
