// State, link, clock, cloud, and the fault with its remedy.
const byId = (id) => document.getElementById(id);
const MOVES = ['moving', 'homing', 'stopping'];

export function showHealth(link) {
  let [fault, refusal, closed, extrapolations] = [null, null, true, []];
  let [forget, units] = [0, []];
  const banner = () => {
    const text = closed ? 'The panel does not answer: waiting for it to come back. If it was closed, start it again.'
      : fault ? `Fault: ${fault}` : refusal;
    if (byId('banner').textContent !== (text ?? '')) byId('banner').textContent = text ?? '';
    byId('banner').hidden = !text;
  };
  const state = (text, kind) => {
    byId('state').textContent = text;
    byId('state').className = `chip strong ${kind}`;
  };
  // The last pose, and how uncertain it has become.
  const showLost = ({ lost_s: gone, sigmas, measures }) => {
    state('no link', 'bad');
    const known = sigmas ? `last pose ±${sigmas.map((sigma, i) => `${sigma.toFixed(2)} ${units[i] === 'mm' ? 'mm' : '°'}`).join(' ±')}, growing` : 'it moved, and nobody saw where it stopped';
    byId('link-chip').textContent = `link lost for ${gone.toFixed(0)} s: ${measures ? known : 'nothing is measured until it is back'}`;
  };
  link.on('open', () => { closed = false; banner(); });
  link.on('closed', () => { closed = true; state('no panel', 'bad'); banner(); });
  link.on('refused', ({ text }) => {
    refusal = text;
    banner();
    clearTimeout(forget);
    forget = setTimeout(() => { refusal = null; banner(); }, 6000);
  });
  link.on('hello', ({ rig, simulated, version, axes }) => {
    units = axes.map(({ unit }) => unit);
    byId('rig-name').textContent = `${rig}${simulated ? ' (simulated)' : ''}`;
    byId('rig-name').title = `vergence ${version}${simulated ? `; simulated: ${simulated}` : ''}`;
    document.title = `${rig} · vergence`;
  });
  link.on('status', (status) => {
    fault = status.fault?.text ?? null;
    state(status.state, fault ? 'bad' : MOVES.includes(status.state) ? 'moves' : 'good');
    byId('mode').hidden = !status.mode;
    byId('mode').textContent = status.mode ?? '';
    const { round_trip_us: trip, poses_lost: lost, retransmitted, lost_s: gone } = status.link;
    byId('link-chip').textContent = `link ${trip === null ? 'not measured' : `${(trip / 1000).toFixed(1)} ms`}${lost + retransmitted ? `, lost ${lost}, repeated ${retransmitted}` : ''}`;
    const { error_us: error, lost: clockLost } = status.clock;
    byId('clock-chip').textContent = clockLost ? 'clock lost' : error === null ? 'clock not compared' : `clock ±${error.toFixed(0)} µs`;
    byId('clock-chip').classList.toggle('bad', clockLost);
    if (gone !== undefined) showLost(status.link);
    byId('link-chip').classList.toggle('bad', gone !== undefined);
    banner();
  });
  // What the live loop does without, in a word each; in whole on the pointer and in the log.
  link.on('ladder', ({ without }) => {
    byId('ladder-chip').hidden = without.length === 0;
    byId('ladder-chip').textContent = without.map(({ rung }) => rung.replaceAll('_', ' ')).join(' · ');
    byId('ladder-chip').title = without.map(({ text }) => text).join('\n');
  });
  link.on('view', (view) => { extrapolations = view.extrapolations; });
  link.on('cloud', (cloud) => {
    const what = cloud.bearings
      ? `${cloud.bearings.count} bearings of the ${cloud.bearings.camera} camera, no range: ${cloud.bearings.why}`
      : `${cloud.count} points of ${cloud.matches} matches`;
    const limit = cloud.points_limit;
    const remarks = [
      limit ? `points limited by time: ${limit.most} of ${limit.of}` : null,
      cloud.drifted ? 'pose drifted' : null,
      cloud.calibration_known === false ? 'calibration unknown' : null,
      extrapolations.length ? 'beyond the calibrated range' : null,
    ].filter(Boolean);
    byId('cloud-chip').textContent = [what, `${cloud.latency_ms.toFixed(0)} ms`, ...remarks].join(' · ');
    byId('cloud-chip').title = extrapolations.join(' ');
    byId('cloud-chip').classList.toggle('bad', Boolean(cloud.bearings) || cloud.drifted === true);
  });
}
