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
// The officer's watch: full screen, a screen that stays on, and an alarm (sound, colour, word) when validity is lost.
(() => {
  const GOOD = ['valid', 'held'], WORSE = ['degraded', 'aligning', 'invalid', 'no news'];  // in this order
  let audio = null, lock = null, before = null;
  const stayOn = async () => {
    try { lock = await navigator.wakeLock?.request('screen'); } catch { lock = null; }  // not on plain http elsewhere
  };
  const beep = () => {
    if (!audio) return;
    for (const at of [0, .4, .8]) {
      const tone = audio.createOscillator(), loudness = audio.createGain();
      tone.frequency.value = 880;
      loudness.gain.value = .3;
      tone.connect(loudness).connect(audio.destination);
      tone.start(audio.currentTime + at);
      tone.stop(audio.currentTime + at + .25);
    }
  };
  document.addEventListener('click', async event => {
    const button = event.target.closest?.('[data-watch]');
    if (!button) return;
    const on = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', on);
    if (on) {
      audio ??= new AudioContext();
      audio.resume();
      await document.documentElement.requestFullscreen?.().catch(() => {});
      await stayOn();
    } else {
      if (document.fullscreenElement) await document.exitFullscreen();
      await lock?.release();
      lock = null;
      audio?.suspend();
    }
  });
  document.addEventListener('visibilitychange', () => {
    const on = document.querySelector('[data-watch]')?.getAttribute('aria-pressed') === 'true';
    if (on && document.visibilityState === 'visible') stayOn();
  });
  setInterval(() => {
    const verdict = document.querySelector('section.verdict');
    const alarm = document.querySelector('[data-alarm]');
    if (!verdict || !alarm) return;
    const late = document.querySelector('.gn').classList.contains('late');
    const now = late ? 'no news' : verdict.dataset.fitness;
    if (GOOD.includes(now)) {
      if (alarm.textContent) alarm.textContent = '';
    } else if (now !== before && (GOOD.includes(before) || alarm.textContent)) {  // a new text is read out each time
      alarm.textContent = `Heading lost: ${now}. Do not steer by it.`;
      if (WORSE.indexOf(now) > WORSE.indexOf(before)) beep();
    }
    before = now;
  }, 500);
})();
