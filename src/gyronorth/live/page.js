// A heading that is not renewed is struck out: the server may be gone, or the network, or the device slept.
(() => {
  const LATE_MS = 3000;
  let beat = null, came = performance.now();
  setInterval(() => {
    const now = document.querySelector('[data-beat]')?.textContent ?? null;
    const verdict = document.querySelector('section.verdict');
    const mark = verdict?.querySelector('[data-verdict]');
    if (now !== beat) {
      beat = now;
      came = performance.now();
    }
    if (!mark) return;
    const silent = performance.now() - came;
    document.querySelector('.gn').classList.toggle('late', silent > LATE_MS);
    if (silent > LATE_MS) {
      verdict.dataset.kind ??= verdict.className;
      mark.dataset.text ??= mark.textContent;
      verdict.className = 'verdict invalid';
      const said = document.querySelector('.gn [role=status]');  // for screen readers, once
      if (said && !said.textContent.startsWith('invalid: no news')) said.textContent = 'invalid: no news from the instrument';
      mark.textContent = `✕ Invalid: no news from the instrument for ${Math.round(silent / 1000)} s`;
    } else if (verdict.dataset.kind) {  // still the section that was struck out, not a new one
      verdict.className = verdict.dataset.kind;
      mark.textContent = mark.dataset.text;
      delete verdict.dataset.kind;
      delete mark.dataset.text;
    }
  }, 500);
})();
