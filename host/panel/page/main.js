// Puts the parts of the page together: each listens to the streams that it shows.
import { connect } from './link.js';
import { showControl } from './control.js';
import { showAxes } from './axes.js';
import { showHealth } from './health.js';
import { showPictures } from './pictures.js';
import { showCloud } from './cloud.js';
import { showPoint } from './point.js';
import { showSphere } from './sphere.js';
import { showTopView } from './top_view.js';
import { showPlots } from './plots.js';
import { showPlan } from './plan.js';
import { showCapture } from './capture.js';
import { showPlayback } from './playback.js';
import { showLog } from './log.js';

const link = connect();
showHealth(link);
// Before the controls: it takes the space bar where nothing can be stopped.
showPlayback(link);
showControl(link);
showAxes(link);
const pictures = showPictures(link);
const cloud = showCloud(link);
showPoint(link, cloud, pictures);
showSphere(link);
showTopView(link);
showPlots(link);
showPlan(link);
showCapture(link, pictures);
showLog(link);
link.open();
