//! What waits for the disk: images and clouds up to a number of bytes, and all else without a limit.
//!
//! Readings, pulses and the other small messages come at some 100 kB a second and are never left out: a replay without them would give other
//! clouds. Images are what fills memory while a disk is slow.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// What may wait, in bytes of memory: 26 images of 1280 x 1280 pixels.
pub const MOST_BYTES: usize = 128 << 20;

/// How much memory an entry holds, and what it counts as where it is left out.
pub trait Weighed {
    /// Its bytes in memory.
    fn bytes(&self) -> usize;

    /// Its counter in `left_out`; `None` of an entry that is never left out.
    fn counter<'a>(&self, left_out: &'a mut LeftOut) -> Option<&'a mut u64>;
}

/// For how many messages the disk had no time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// Images.
    pub images: u64,
    /// Clouds.
    pub clouds: u64,
}

impl LeftOut {
    /// A sentence that says what was left out and what to do; `None` where nothing was.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        let Self { images, clouds } = self;
        (images + clouds > 0).then(|| {
            format!(
                "the disk had no time for {images} images and {clouds} clouds, which are not in the recording; readings and pulses are: \
                 record fewer frames (--rate), or on a faster disk"
            )
        })
    }
}

/// The entries that wait. A clone is the same queue.
#[derive(Debug)]
pub struct Queue<T> {
    waiting: Arc<Mutex<Waiting<T>>>,
    news: Arc<Notify>,
}

impl<T> Clone for Queue<T> {
    fn clone(&self) -> Self {
        Self { waiting: Arc::clone(&self.waiting), news: Arc::clone(&self.news) }
    }
}

#[derive(Debug)]
struct Waiting<T> {
    entries: VecDeque<T>,
    /// Bytes of the entries, and of the one that is being written.
    bytes: usize,
    being_written: usize,
    most_bytes: usize,
    /// Whether images and clouds are left out until half of the room is free: without a pause, one image of each pair would be kept.
    is_full: bool,
    is_closed: bool,
    left_out: LeftOut,
    trouble: Option<String>,
}

impl<T: Weighed> Queue<T> {
    /// An empty queue, in which images and clouds of so many bytes may wait.
    pub fn new(most_bytes: usize) -> Self {
        let waiting = Waiting {
            entries: VecDeque::new(),
            bytes: 0,
            being_written: 0,
            most_bytes,
            is_full: false,
            is_closed: false,
            left_out: LeftOut::default(),
            trouble: None,
        };
        Self { waiting: Arc::new(Mutex::new(waiting)), news: Arc::default() }
    }

    /// Adds an entry, or counts it where there is no room. Never waits for the disk.
    pub fn put(&self, entry: T) {
        self.lock().put(entry);
        self.news.notify_one();
    }

    /// Takes no more entries; those that wait are still written.
    pub fn close(&self) {
        self.lock().is_closed = true;
        self.news.notify_one();
    }

    /// Takes no more entries, and forgets those that wait; `why` is a sentence.
    pub fn abandon(&self, why: String) {
        let mut waiting = self.lock();
        waiting.is_closed = true;
        waiting.entries.clear();
        waiting.trouble = Some(why);
    }

    /// A sentence where the first image or cloud was left out, or nothing is written any more; each once.
    pub fn take_trouble(&self) -> Option<String> {
        self.lock().trouble.take()
    }

    /// What was left out so far.
    pub fn left_out(&self) -> LeftOut {
        self.lock().left_out
    }

    /// Waits for an entry; false once the queue is closed and empty.
    pub async fn is_filled(&self) -> bool {
        loop {
            // One who waits is enough: what comes in between is remembered.
            let news = self.news.notified();
            let (is_empty, is_closed) = {
                let waiting = self.lock();
                (waiting.entries.is_empty(), waiting.is_closed)
            };
            match (is_empty, is_closed) {
                (false, _) => return true,
                (true, true) => return false,
                (true, false) => news.await,
            }
        }
    }

    /// The oldest entry. What was taken before counts as written.
    pub fn take(&self) -> Option<T> {
        self.lock().take()
    }

    /// A poisoned lock only means that another thread panicked; no update leaves the entries half changed.
    fn lock(&self) -> MutexGuard<'_, Waiting<T>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Weighed> Waiting<T> {
    fn put(&mut self, entry: T) {
        if self.is_closed {
            return;
        }
        let bytes = entry.bytes();
        self.is_full &= self.bytes > self.most_bytes / 2;
        // An image that is larger than the whole room is kept where nothing else waits.
        let has_room = !self.is_full && (self.bytes == 0 || self.bytes + bytes <= self.most_bytes);
        let is_first = self.left_out == LeftOut::default();
        if !has_room && let Some(counter) = entry.counter(&mut self.left_out) {
            *counter += 1;
            self.is_full = true;
            if is_first {
                self.trouble = Some("the disk is too slow: images and clouds are left out of the recording".to_owned());
            }
            return;
        }
        self.bytes += bytes;
        self.entries.push_back(entry);
    }

    fn take(&mut self) -> Option<T> {
        self.bytes -= std::mem::take(&mut self.being_written);
        let entry = self.entries.pop_front()?;
        self.being_written = entry.bytes();
        Some(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    enum Sample {
        Reading,
        Image(usize),
    }

    impl Weighed for Sample {
        fn bytes(&self) -> usize {
            match self {
                Self::Reading => 1,
                Self::Image(bytes) => *bytes,
            }
        }

        fn counter<'a>(&self, left_out: &'a mut LeftOut) -> Option<&'a mut u64> {
            matches!(self, Self::Image(_)).then_some(&mut left_out.images)
        }
    }

    fn images(queue: &Queue<Sample>) -> usize {
        std::iter::from_fn(|| queue.take()).filter(|entry| *entry != Sample::Reading).count()
    }

    #[test]
    fn images_wait_up_to_the_limit_and_readings_without_one() {
        let queue = Queue::new(100);
        for _ in 0..50 {
            queue.put(Sample::Image(30));
            queue.put(Sample::Reading);
        }
        assert_eq!(queue.left_out(), LeftOut { images: 47, clouds: 0 });
        assert_eq!(queue.lock().bytes, 3 * 30 + 50);
        assert_eq!(images(&queue), 3);
        assert_eq!(queue.lock().bytes, 0);
    }

    #[test]
    fn a_full_queue_takes_images_again_when_half_of_the_room_is_free_and_counts_the_one_that_is_being_written() {
        let queue = Queue::new(100);
        (0..5).for_each(|_| queue.put(Sample::Image(25)));
        assert_eq!(queue.left_out().images, 1);
        queue.take();
        queue.put(Sample::Image(25));
        queue.take();
        queue.put(Sample::Image(25));
        assert_eq!(queue.left_out().images, 3, "75 bytes are taken");
        queue.take();
        queue.put(Sample::Image(25));
        assert_eq!((queue.left_out().images, queue.lock().bytes), (3, 75));
    }

    #[test]
    fn an_image_larger_than_the_room_waits_alone() {
        let queue = Queue::new(100);
        queue.put(Sample::Image(150));
        queue.put(Sample::Image(150));
        assert_eq!((queue.left_out().images, images(&queue)), (1, 1));
    }

    #[tokio::test]
    async fn a_closed_queue_is_written_to_its_end_and_an_abandoned_one_is_not() {
        let queue = Queue::new(100);
        queue.put(Sample::Reading);
        queue.close();
        queue.put(Sample::Reading);
        assert!(queue.is_filled().await);
        assert!(queue.take().is_some() && queue.take().is_none());
        assert!(!queue.is_filled().await);
        let abandoned = Queue::new(100);
        abandoned.put(Sample::Reading);
        abandoned.abandon("the disk is full".into());
        assert!(!abandoned.is_filled().await);
        assert_eq!((abandoned.take_trouble().as_deref(), abandoned.take_trouble()), (Some("the disk is full"), None));
    }
}
