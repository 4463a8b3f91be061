// What the pages of a launch do inside a learning platform's frame.
// Source: LTI Client Side postMessages 1.0, LTI postMessage Storage 1.0, LTI Dynamic Registration 1.0.

const PATIENCE_MS = 2000;
const root = document.querySelector("[data-lti]");
const { lti, storage, origin, name, key, address } = root.dataset;

// Asks the platform's frame that stores values for tools. Rejects after a while: not every platform answers.
function ask(subject, values) {
  return new Promise((resolve, reject) => {
    const id = crypto.randomUUID();
    const platform = window.parent !== window ? window.parent : window.opener;
    const frame = storage === "_parent" ? platform : platform?.frames[storage];
    if (!frame) return reject(new Error("there is no such frame"));
    const silence = setTimeout(() => reject(new Error("no answer")), PATIENCE_MS);
    window.addEventListener("message", (event) => {
      if (event.origin !== origin || event.data?.message_id !== id || event.data.subject !== `${subject}.response`) return;
      clearTimeout(silence);
      if (event.data.error) reject(new Error(event.data.error.message)); else resolve(event.data.value);
    });
    frame.postMessage({ subject, message_id: id, ...values }, origin);
  });
}

// The key that binds the login to this browser; where it is not kept, the launch asks for a new tab.
async function keep() {
  await ask("lti.put_data", { key: name, value: key }).catch(() => null);
  location.replace(address);
}

async function bring() {
  const form = root.querySelector("form");
  form.elements.key.value = await ask("lti.get_data", { key: name }).catch(() => null) ?? "";
  form.submit();
}

function close() {
  root.querySelector("button").addEventListener("click", () => {
    const platform = window.opener ?? window.parent;
    platform.postMessage({ subject: "org.imsglobal.lti.close" }, "*");
  });
}

const actions = { keep, bring, close, send: () => root.querySelector("form").submit() };
actions[lti]();
