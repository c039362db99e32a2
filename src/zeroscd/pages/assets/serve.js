"use strict";
{
  const POLL_MS = 300;
  const QUIET_MS = 150; // without a move of a slider before the result is asked for
  const STEPS = {
    wait: "Waiting",
    read: "Reading the photos",
    encode: "Encoding both photos",
    compare: "Comparing them",
    decide: "Drawing outlines",
    draw: "Preparing the pictures",
  };
  const find = (id) => document.getElementById(id);
  const box = (when) => document.querySelector(`[data-photo="${when}"]`);
  const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1).replace(/\.?$/, ".");
  const form = find("form");
  const limits = { bytes: Number(form.dataset.maxBytes), pixels: Number(form.dataset.maxPixels) };

  /* The two photos, as chosen. */
  const photos = { before: null, after: null };
  const choices = { before: 0, after: 0 };

  function note(when, text, refused = false) {
    box(when).querySelector(".note").textContent = text;
    box(when).classList.toggle("refused", refused);
  }

  async function isPhoto(file) {
    const head = String.fromCharCode(...new Uint8Array(await file.slice(0, 12).arrayBuffer()));
    return /^(\xff\xd8\xff|\x89PNG\r\n\x1a\n|RIFF[^]{4}WEBP)/.test(head);
  }

  async function refusal(file, image) {
    if (file.size > limits.bytes) {
      return `this file has ${Math.ceil(file.size / 1e6)} megabytes, more than ${limits.bytes / 1e6}; make it smaller`;
    }
    if (!(await isPhoto(file))) return "this is no photo that the server reads; send a JPEG, PNG or WebP file";
    image.src = URL.createObjectURL(file);
    try {
      await image.decode();
    } catch {
      return "this photo is damaged; choose another";
    }
    const pixels = image.naturalWidth * image.naturalHeight;
    if (pixels > limits.pixels) {
      return `this photo has ${image.naturalWidth} × ${image.naturalHeight} pixels, more than ${limits.pixels / 1e6} million; scale it down`;
    }
    return "";
  }

  async function choose(when, file) {
    const choice = ++choices[when];
    const image = new Image();
    const problem = await refusal(file, image);
    if (choice !== choices[when]) return URL.revokeObjectURL(image.src);
    const old = box(when).querySelector("img");
    URL.revokeObjectURL(old.src);
    image.alt = old.alt;
    image.hidden = problem !== "";
    old.replaceWith(image);
    photos[when] = problem ? null : file;
    find("failure").textContent = "";
    if (problem) note(when, sentence(problem), true);
    else note(when, `${file.name ? file.name + ", " : ""}${image.naturalWidth} × ${image.naturalHeight} pixels`);
  }

  async function takeSamples() {
    for (const when of ["before", "after"]) {
      try {
        const answer = await fetch(`samples/${when}.jpg`);
        if (!answer.ok) throw new Error();
        await choose(when, await answer.blob());
      } catch {
        note(when, "The sample photo cannot be fetched.", true);
      }
    }
  }

  /* How things stand. */
  function say(text, percent = null) {
    find("status").textContent = text;
    find("failure").textContent = "";
    find("progress").hidden = percent === null;
    find("progress").value = percent ?? 0;
  }

  function fail(text) {
    say("");
    find("failure").textContent = sentence(text);
  }

  async function problemOf(answer) {
    const problem = await answer.json().catch(() => ({}));
    return problem.detail || "the server cannot do this now; try again";
  }

  /* One comparison at a time: `turn` tells answers for an older one. */
  let turn = 0;
  let current = null; // { id, preset, running, moved }
  let upload = null;

  function fields() {
    const data = new FormData();
    data.set("frame", form.elements.frame.value);
    data.set("sensitivity", find("sensitivity").value);
    const thresholds = { alpha: Number(find("alpha").value), min_area_px: Number(find("area").value) };
    data.set("settings", JSON.stringify(thresholds));
    return data;
  }

  function forget() {
    if (upload) upload.abort();
    if (current) fetch(`v1/comparisons/${current.id}`, { method: "DELETE", keepalive: true }).catch(() => {});
    upload = current = null;
  }

  /* Resolves to the server's answer; fetch could not tell how much has been sent. */
  function send(data) {
    return new Promise((resolve, reject) => {
      upload = new XMLHttpRequest();
      upload.open("POST", "v1/comparisons");
      upload.upload.onprogress = (event) => say("Sending the photos", (100 * event.loaded) / event.total);
      upload.onload = () => resolve(new Response(upload.responseText || null, { status: upload.status }));
      upload.onerror = reject;
      upload.send(data);
    });
  }

  async function compare() {
    const mine = ++turn;
    forget();
    find("result").replaceChildren();
    const missing = ["before", "after"].find((when) => !photos[when]);
    if (missing) return fail(`choose the photo ${missing} first`);
    const data = fields();
    data.set("preset", find("preset").value);
    for (const when of ["before", "after"]) data.set(when, photos[when], when);
    say("Sending the photos", 0);
    try {
      const answer = await send(data);
      upload = null;
      if (answer.status !== 202) {
        if (mine === turn) fail(await problemOf(answer));
        return;
      }
      const { id, preset } = await answer.json();
      current = { id, preset, running: true, moved: false };
      if (mine !== turn) return forget();
      await follow(mine);
    } catch {
      if (mine === turn) fail("the server cannot be reached; try again");
    }
  }

  async function follow(mine) {
    while (mine === turn) {
      const answer = await fetch(`v1/comparisons/${current.id}`);
      if (mine !== turn) return;
      if (!answer.ok) return fail(await problemOf(answer));
      const { status, step, percent, ahead, problem, result } = await answer.json();
      if (mine !== turn) return;
      if (status === "failed") return fail(problem);
      if (status === "done") {
        current.running = false;
        await show(result, mine);
        if (current?.moved) decide();
        return;
      }
      say(ahead ? `Waiting: ${ahead} before you` : STEPS[step], percent);
      await new Promise((resolve) => setTimeout(resolve, POLL_MS));
    }
  }

  /* Other thresholds, without encoding again: the last move counts. */
  let quiet = null;
  let deciding = null;

  function move() {
    if (!current) return;
    if (current.running) return (current.moved = true);
    clearTimeout(quiet);
    quiet = setTimeout(decide, QUIET_MS);
  }

  async function decide() {
    const mine = turn;
    deciding?.abort();
    if (current.preset !== find("preset").value) {
      return say("Press Compare to see the photos with these settings.");
    }
    const { signal } = (deciding = new AbortController());
    say(STEPS.decide, 50);
    try {
      const address = `v1/comparisons/${current.id}/results`;
      const answer = await fetch(address, { method: "POST", body: fields(), signal });
      if (mine !== turn) return;
      if (answer.ok) return await show(await answer.json(), mine);
      if (answer.status === 404) fail("this result is no longer kept; press Compare");
      else fail(await problemOf(answer));
    } catch {
      if (mine === turn && !signal.aborted) fail("the server cannot be reached; try again");
    }
  }

  async function show(result, mine) {
    const answer = await fetch(`viewer/${current.id}/${result.number}`);
    const html = await answer.text();
    if (mine !== turn) return;
    if (!answer.ok) return; // a newer result is on its way
    const old = find("result").querySelector("[data-viewer]");
    const made = document.createElement("template");
    made.innerHTML = html;
    // What HTML may not carry under the content security policy, a script may set.
    for (const part of made.content.querySelectorAll("[data-style]")) {
      part.style.cssText = part.dataset.style;
    }
    find("result").replaceChildren(made.content);
    window.zeroscdViewer(find("result").querySelector("[data-viewer]"), old);
    const count = result.regions;
    say(count ? `Done: ${count} changed ${count === 1 ? "region" : "regions"}, shown below.` : "Done: no change found.");
  }

  /* Events. */
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    compare();
  });
  form.addEventListener("change", (event) => {
    const file = event.target.type === "file" && event.target.files[0];
    if (file) {
      choose(event.target.closest("[data-photo]").dataset.photo, file);
      event.target.value = "";
    }
  });
  find("preset").addEventListener("input", (event) => {
    const own = event.target.selectedOptions[0].dataset;
    find("sensitivity").value = form.dataset.half;
    find("alpha").value = own.alpha;
    find("area").value = own.area;
    for (const slider of document.querySelectorAll(".slider input")) label(slider);
  });
  const label = (slider) => (find(slider.id + "-value").textContent = slider.value);
  form.addEventListener("input", (event) => {
    if (event.target.closest(".slider")) label(event.target);
    if (event.target.closest(".panel")) move();
  });
  document.querySelector("[data-sample]").addEventListener("click", takeSamples);

  for (const kind of ["dragover", "dragleave", "drop"]) {
    document.addEventListener(kind, (event) => {
      event.preventDefault(); // a photo dropped beside a box must not replace the page
      const target = event.target.closest?.("[data-photo]");
      for (const one of document.querySelectorAll("[data-photo]")) {
        one.classList.toggle("over", kind === "dragover" && one === target);
      }
      const file = kind === "drop" && event.dataTransfer.files[0];
      if (target && file) choose(target.dataset.photo, file);
    });
  }

  // Whoever leaves frees the server's worker.
  window.addEventListener("pagehide", () => (current?.running || upload) && forget());
}
