//! One open page: what it gets, and what it asks.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use serde_json::json;
use tokio::sync::mpsc::{Receiver, Sender, channel};
use tokio::time::{sleep, timeout};
use vergence_rig::{AxisPosition, Rig, rounded};

use crate::hub::{Hub, text_message};
use crate::message::{GoalOrder, PageMessage};
use crate::operators::ClientId;
use crate::streams::{Outgoing, Seen, Stream};
use crate::view::{PIXEL_SIGMA, sphere_message, view_json};

/// A page that takes no message for this long is gone.
const PATIENCE: Duration = Duration::from_secs(30);
/// Answers that may wait for a page.
const ANSWERS_KEPT: usize = 8;
/// Shortest time between two views from above, and between two maps of all directions, which cost some milliseconds each.
const VIEW_PACE: Duration = Duration::from_millis(150);
const SPHERE_PACE: Duration = Duration::from_millis(500);
/// The view is computed anew when an axis is this far from where it was, in millimetres or radians.
const SMALL_STEP: f64 = 1e-3;

/// Serves an open page until it is gone.
pub async fn serve_page(hub: Arc<Hub>, client: ClientId, socket: WebSocket) {
    let (sink, stream) = socket.split();
    let (answer, answers) = channel(ANSWERS_KEPT);
    tokio::select! {
        () = write(&hub, client, sink, answers) => {}
        () = read(&hub, client, stream, answer) => {}
    }
    hub.leave(client);
}

/// Sends the latest of every stream, and answers before all of them.
async fn write(hub: &Hub, client: ClientId, mut sink: SplitSink<WebSocket, Message>, mut answers: Receiver<Outgoing>) {
    let (mut changes, mut seen) = (hub.changes(), Seen::default());
    let mut next = Some(hub.hello(client));
    loop {
        match next.take() {
            Some(message) => {
                let message = match message {
                    Outgoing::Text(text) => Message::Text(text),
                    Outgoing::Binary(bytes) => Message::Binary(bytes),
                };
                if !matches!(timeout(PATIENCE, sink.send(message)).await, Ok(Ok(()))) {
                    return;
                }
            }
            None => tokio::select! {
                Some(answer) = answers.recv() => next = Some(answer),
                changed = changes.changed() => {
                    if changed.is_err() {
                        return;
                    }
                }
            },
        }
        next = next.or_else(|| answers.try_recv().ok()).or_else(|| hub.next(&mut seen));
    }
}

/// Hears what the page asks until it is gone.
async fn read(hub: &Arc<Hub>, client: ClientId, mut stream: SplitStream<WebSocket>, answer: Sender<Outgoing>) {
    while let Some(Ok(message)) = stream.next().await {
        let Message::Text(text) = message else { continue };
        let taken = match serde_json::from_str::<PageMessage>(&text) {
            Ok(PageMessage::Plan(order)) => plan(hub, order, &answer),
            Ok(message) => hub.take(client, message),
            Err(error) => Err(format!("the panel does not understand this: {error}")),
        };
        if let Err(why) = taken {
            // A page that asks faster than it reads misses refusals.
            let _ = answer.try_send(text_message(&json!({ "kind": "refused", "text": why })));
        }
    }
}

/// Begins to search the pose for a goal; the answer comes when it is found.
fn plan(hub: &Arc<Hub>, order: GoalOrder, answer: &Sender<Outgoing>) -> Result<(), String> {
    let goal = order.goal().ok_or("a goal has lengths above zero and a width below 180 degrees")?;
    let turn = Arc::clone(&hub.planning).try_acquire_owned();
    let turn = turn.map_err(|_| "another search for a pose is under way: wait a moment".to_owned())?;
    let (rig, answer) = (Arc::clone(&hub.setting.rig), answer.clone());
    tokio::task::spawn_blocking(move || {
        let best = rig.best_pose(&goal, PIXEL_SIGMA);
        let values = best.positions(&rig).into_iter().map(AxisPosition::mm_or_deg).map(rounded);
        let mut message = best.json(&rig);
        message["kind"] = json!("plan");
        message["goal"] = json!(goal.to_string());
        message["values"] = values.collect();
        drop(turn);
        // A page that is gone needs no answer.
        let _ = answer.try_send(text_message(&message));
    });
    Ok(())
}

/// Follows the stages with the view from above and with the map of all directions, each at its pace, while pages are open.
pub async fn follow_view(hub: Arc<Hub>) {
    tokio::join!(
        follow_stages(&hub, Stream::View, VIEW_PACE, |rig, values| text_message(&view_json(rig, values))),
        follow_stages(&hub, Stream::Sphere, SPHERE_PACE, sphere_message),
    );
}

/// Makes a message each time that the stages are elsewhere, at most once in `pace`.
async fn follow_stages(hub: &Hub, stream: Stream, pace: Duration, message: fn(&Rig, &[f64]) -> Outgoing) {
    let (mut places, mut pages, mut shown) = (hub.place.subscribe(), hub.pages.subscribe(), None::<Vec<f64>>);
    places.mark_changed();
    // The hub keeps both senders: they are not closed.
    while pages.wait_for(|count| *count > 0).await.is_ok() && places.changed().await.is_ok() {
        let Some(values) = places.borrow_and_update().clone() else { continue };
        let near = |(a, b): (&f64, &f64)| (a - b).abs() < SMALL_STEP;
        if shown.as_ref().is_some_and(|shown| shown.iter().zip(&values).all(near)) {
            continue;
        }
        let (rig, at) = (Arc::clone(&hub.setting.rig), values.clone());
        let Ok(computed) = tokio::task::spawn_blocking(move || message(&rig, &at)).await else { continue };
        hub.put(stream, computed);
        shown = Some(values);
        sleep(pace).await;
    }
}
