// A stand-in for the kernel's V4L2 devices /dev/video0, 1 and 2, preloaded into the program under test: it answers the ioctls that the
// program makes, refuses what the kernel refuses, and logs each. The program, its V4L2 library and its mappings are the real ones.
//
// Rules are those of the kernel's documentation (userspace-api/media/v4l: vidioc-qbuf, vidioc-reqbufs, vidioc-g-fmt, vidioc-streamon,
// vidioc-queryctrl) for a USB camera that does not block. Two cameras of 320 x 320 pixels run in step at 10 Hz, the second 2 ms late; video2
// gives metadata, as the second device file of UVC cameras does. Frames for which no buffer is queued are lost, and their numbers with them.
//
// FAKE_V4L_DIR stands for /dev where that is listed, FAKE_V4L_LOG is appended to, FAKE_V4L_VANISH unplugs the cameras after so many frames,
// FAKE_V4L_LOSE loses every so manieth frame, FAKE_V4L_DARK keeps the lens cap on the second camera.
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define SIZE 320
#define BUFFERS 8
#define LONGEST (SIZE * SIZE * 2)
#define RATE 10
#define TRIGGER_MODE (V4L2_CID_CAMERA_CLASS_BASE + 0x80)
#define RECT_KIND 0x0107

typedef struct {
    int fd, streaming, count, exposure_mode;
    long long exposure, gain, trigger;
    unsigned fourcc, sequence;
    long long next_ns;
    unsigned char *memory;
    int queued[BUFFERS], queued_count;
    struct v4l2_buffer done[BUFFERS];
    int done_count;
} Camera;

static Camera cameras[3] = {
    {.fd = -1, .fourcc = V4L2_PIX_FMT_YUYV, .exposure_mode = 3, .exposure = 156, .gain = 16},
    {.fd = -1, .fourcc = V4L2_PIX_FMT_YUYV, .exposure_mode = 3, .exposure = 156, .gain = 16},
    {.fd = -1},
};
// Numbers of the camera behind each file descriptor, plus one.
static char opened[1024];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static long long now_ns(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec * 1000000000LL + time.tv_nsec;
}

static long number_of(const char *name) {
    const char *text = getenv(name);
    return text ? atol(text) : 0;
}

static void note(int camera, const char *format, ...) {
    const char *path = getenv("FAKE_V4L_LOG");
    FILE *log = path ? fopen(path, "a") : NULL;
    if (!log) return;
    fprintf(log, "video%d ", camera);
    va_list values;
    va_start(values, format);
    vfprintf(log, format, values);
    va_end(values);
    fputc('\n', log);
    fclose(log);
}

static int camera_of(const char *path) {
    if (strncmp(path, "/dev/video", 10) || path[10] < '0' || path[10] > '2' || path[11]) return -1;
    return path[10] - '0';
}

static int has_vanished(const Camera *camera) {
    long vanish = number_of("FAKE_V4L_VANISH");
    return vanish && (long)camera->sequence > vanish;
}

static int open_camera(int number) {
    if (has_vanished(&cameras[number])) return errno = ENODEV, -1;
    int fd = memfd_create("fake-v4l", 0);
    if (fd < 0 || fd >= (int)sizeof opened || ftruncate(fd, BUFFERS * LONGEST)) return -1;
    opened[fd] = (char)(number + 1);
    note(number, "open");
    return fd;
}

int open(const char *path, int flags, ...) {
    static int (*real)(const char *, int, ...);
    if (!real) real = dlsym(RTLD_NEXT, "open");
    va_list values;
    va_start(values, flags);
    int mode = va_arg(values, int);
    va_end(values);
    int number = camera_of(path);
    return number >= 0 ? open_camera(number) : real(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    static int (*real)(const char *, int, ...);
    if (!real) real = dlsym(RTLD_NEXT, "open64");
    va_list values;
    va_start(values, flags);
    int mode = va_arg(values, int);
    va_end(values);
    int number = camera_of(path);
    return number >= 0 ? open_camera(number) : real(path, flags, mode);
}

DIR *opendir(const char *path) {
    static DIR *(*real)(const char *);
    if (!real) real = dlsym(RTLD_NEXT, "opendir");
    const char *stand_in = getenv("FAKE_V4L_DIR");
    return real(stand_in && !strcmp(path, "/dev") ? stand_in : path);
}

int close(int fd) {
    static int (*real)(int);
    if (!real) real = dlsym(RTLD_NEXT, "close");
    if (fd >= 0 && fd < (int)sizeof opened && opened[fd]) {
        Camera *camera = &cameras[opened[fd] - 1];
        // Who streamed has let go.
        if (camera->fd == fd) camera->fd = -1, camera->streaming = camera->count = camera->queued_count = camera->done_count = 0;
        opened[fd] = 0;
    }
    return real(fd);
}

static unsigned length_of(const Camera *camera) {
    return camera->fourcc == V4L2_PIX_FMT_YUYV ? SIZE * SIZE * 2 : SIZE * SIZE;
}

// Squares of 8 pixels, grey from 60 to 180.
static void draw(Camera *camera, unsigned char *bytes) {
    int is_dark = camera == &cameras[1] && number_of("FAKE_V4L_DARK");
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) {
            unsigned char level = is_dark ? 0 : (((x / 8) ^ (y / 8)) & 1) ? 180 : 60;
            if (camera->fourcc == V4L2_PIX_FMT_GREY) bytes[y * SIZE + x] = level;
            else bytes[2 * (y * SIZE + x)] = level, bytes[2 * (y * SIZE + x) + 1] = 128;
        }
}

// Fills queued buffers with the frames that have come by now.
static void advance(Camera *camera) {
    long lose = number_of("FAKE_V4L_LOSE");
    for (long long now = now_ns(); camera->streaming && camera->next_ns <= now; camera->next_ns += 1000000000LL / RATE) {
        unsigned sequence = camera->sequence++;
        if (!camera->queued_count || (lose && sequence % lose == lose - 1)) continue;
        int index = camera->queued[0];
        memmove(camera->queued, camera->queued + 1, --camera->queued_count * sizeof(int));
        draw(camera, camera->memory + index * LONGEST);
        struct v4l2_buffer *done = &camera->done[camera->done_count++];
        memset(done, 0, sizeof *done);
        done->index = index;
        done->bytesused = length_of(camera);
        done->sequence = sequence;
        done->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_EOF;
        done->timestamp.tv_sec = camera->next_ns / 1000000000LL;
        done->timestamp.tv_usec = camera->next_ns % 1000000000LL / 1000;
    }
}

int poll(struct pollfd *fds, nfds_t count, int timeout) {
    static int (*real)(struct pollfd *, nfds_t, int);
    if (!real) real = dlsym(RTLD_NEXT, "poll");
    if (count != 1 || fds->fd < 0 || fds->fd >= (int)sizeof opened || !opened[fds->fd]) return real(fds, count, timeout);
    Camera *camera = &cameras[opened[fds->fd] - 1];
    for (long long end = now_ns() + timeout * 1000000LL;;) {
        pthread_mutex_lock(&lock);
        advance(camera);
        int ready = camera->done_count > 0 || has_vanished(camera);
        pthread_mutex_unlock(&lock);
        if (ready) return fds->revents = POLLIN, 1;
        if (timeout >= 0 && now_ns() > end) return 0;
        usleep(500);
    }
}

static int set_format(Camera *camera, int number, struct v4l2_format *format) {
    struct v4l2_pix_format *pix = &format->fmt.pix;
    if (format->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return EINVAL;
    if (camera->count) return EBUSY;
    note(number, "S_FMT %.4s %ux%u", (char *)&pix->pixelformat, pix->width, pix->height);
    // A driver never refuses a format: it gives the nearest that it has.
    camera->fourcc = pix->pixelformat == V4L2_PIX_FMT_GREY ? V4L2_PIX_FMT_GREY : V4L2_PIX_FMT_YUYV;
    return 0;
}

static void fill_format(const Camera *camera, struct v4l2_format *format) {
    struct v4l2_pix_format *pix = &format->fmt.pix;
    memset(pix, 0, sizeof *pix);
    pix->width = pix->height = SIZE;
    pix->pixelformat = camera->fourcc;
    pix->field = V4L2_FIELD_NONE;
    pix->bytesperline = camera->fourcc == V4L2_PIX_FMT_YUYV ? 2 * SIZE : SIZE;
    pix->sizeimage = length_of(camera);
}

static long long *control_of(Camera *camera, unsigned id, long long *mode) {
    switch (id) {
    case V4L2_CID_GAIN: return &camera->gain;
    case V4L2_CID_EXPOSURE_AUTO: return *mode = camera->exposure_mode, mode;
    case V4L2_CID_EXPOSURE_ABSOLUTE: return &camera->exposure;
    case TRIGGER_MODE: return &camera->trigger;
    default: return NULL;
    }
}

static const struct { unsigned id, type; const char *name; } CONTROLS[] = {
    {V4L2_CID_GAIN, V4L2_CTRL_TYPE_INTEGER, "Gain"},
    {V4L2_CID_EXPOSURE_AUTO, V4L2_CTRL_TYPE_MENU, "Auto Exposure"},
    {V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CTRL_TYPE_INTEGER, "Exposure Time, Absolute"},
    {V4L2_CID_EXPOSURE_ABSOLUTE + 90, RECT_KIND, "Region of Interest Rectangle"},
    {TRIGGER_MODE, V4L2_CTRL_TYPE_INTEGER, "Trigger Mode"},
};

static int query_control(struct v4l2_query_ext_ctrl *query) {
    unsigned flags = query->id & (V4L2_CTRL_FLAG_NEXT_CTRL | V4L2_CTRL_FLAG_NEXT_COMPOUND), id = query->id & ~flags;
    for (unsigned n = 0; n < sizeof CONTROLS / sizeof *CONTROLS; n++) {
        int is_compound = CONTROLS[n].type >= 0x100;
        int fits = flags ? CONTROLS[n].id > id && (flags & (is_compound ? V4L2_CTRL_FLAG_NEXT_COMPOUND : V4L2_CTRL_FLAG_NEXT_CTRL))
                         : CONTROLS[n].id == id;
        if (!fits) continue;
        memset(query, 0, sizeof *query);
        query->id = CONTROLS[n].id;
        query->type = CONTROLS[n].type;
        strcpy(query->name, CONTROLS[n].name);
        query->maximum = 10000;
        query->step = 1;
        return 0;
    }
    return EINVAL;
}

static int controls(Camera *camera, int number, struct v4l2_ext_controls *list, int sets) {
    for (unsigned n = 0; n < list->count; n++) {
        struct v4l2_ext_control *control = &list->controls[n];
        long long mode, *value = control_of(camera, control->id, &mode);
        if (!value) return EINVAL;
        if (!sets) { control->value = (int)*value; continue; }
        note(number, "S_EXT_CTRLS %#x %d", control->id, control->value);
        // As UVC cameras: the time cannot be set while it is automatic.
        if (control->id == V4L2_CID_EXPOSURE_ABSOLUTE && camera->exposure_mode != V4L2_EXPOSURE_MANUAL) return EACCES;
        if (control->id == V4L2_CID_EXPOSURE_AUTO) camera->exposure_mode = control->value;
        else *value = control->value;
    }
    return 0;
}

static int request_buffers(Camera *camera, int fd, struct v4l2_requestbuffers *request) {
    if (request->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || request->memory != V4L2_MEMORY_MMAP) return EINVAL;
    if (camera->streaming || (camera->count && camera->fd != fd)) return EBUSY;
    camera->count = request->count = request->count > BUFFERS ? BUFFERS : request->count;
    camera->queued_count = camera->done_count = 0;
    camera->fd = camera->count ? fd : -1;
    if (camera->count) camera->memory = mmap(NULL, BUFFERS * LONGEST, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    return camera->memory == MAP_FAILED ? ENOMEM : 0;
}

static int buffer(Camera *camera, unsigned long request, struct v4l2_buffer *asked) {
    if (asked->type != V4L2_BUF_TYPE_VIDEO_CAPTURE) return EINVAL;
    if (request != VIDIOC_QUERYBUF && asked->memory != V4L2_MEMORY_MMAP) return EINVAL;
    if (request == VIDIOC_DQBUF) {
        if (!camera->streaming) return EINVAL;
        if (has_vanished(camera)) return ENODEV;
        advance(camera);
        if (!camera->done_count) return EAGAIN;
        struct v4l2_buffer done = camera->done[0];
        memmove(camera->done, camera->done + 1, --camera->done_count * sizeof done);
        done.type = asked->type, done.memory = asked->memory, done.m.offset = done.index * LONGEST, done.length = length_of(camera);
        *asked = done;
        return 0;
    }
    if ((int)asked->index >= camera->count) return EINVAL;
    if (request == VIDIOC_QUERYBUF) {
        asked->length = length_of(camera);
        asked->m.offset = asked->index * LONGEST;
        return 0;
    }
    for (int n = 0; n < camera->queued_count; n++)
        if (camera->queued[n] == (int)asked->index) return EINVAL;
    advance(camera);
    camera->queued[camera->queued_count++] = asked->index;
    return 0;
}

static int stream(Camera *camera, int number, int type, int on) {
    if (type != V4L2_BUF_TYPE_VIDEO_CAPTURE || (on && !camera->count)) return EINVAL;
    if (has_vanished(camera)) return ENODEV;
    camera->streaming = on;
    camera->sequence = camera->done_count = 0;
    if (!on) return camera->queued_count = 0;
    long long period = 1000000000LL / RATE;
    camera->next_ns = (now_ns() / period + 1) * period + number * 2000000LL;
    return 0;
}

static int describe(Camera *camera, int number, unsigned long request, void *at) {
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *caps = at;
        memset(caps, 0, sizeof *caps);
        strcpy((char *)caps->driver, "fake");
        snprintf((char *)caps->card, sizeof caps->card, "Fake camera %d", number);
        snprintf((char *)caps->bus_info, sizeof caps->bus_info, "platform:fake-%d", number);
        caps->device_caps = (number == 2 ? V4L2_CAP_META_CAPTURE : V4L2_CAP_VIDEO_CAPTURE) | V4L2_CAP_STREAMING;
        caps->capabilities = caps->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_ENUM_FMT: {
        struct v4l2_fmtdesc *format = at;
        static const unsigned FOURCC[] = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_SBGGR10};
        if (format->type != V4L2_BUF_TYPE_VIDEO_CAPTURE || format->index > 2) return EINVAL;
        format->pixelformat = FOURCC[format->index];
        return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
        struct v4l2_frmsizeenum *size = at;
        if (size->index) return EINVAL;
        size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
        size->discrete.width = size->discrete.height = SIZE;
        return 0;
    }
    case VIDIOC_ENUM_FRAMEINTERVALS: {
        struct v4l2_frmivalenum *interval = at;
        if (interval->index > 1 || interval->width != SIZE) return EINVAL;
        interval->type = V4L2_FRMIVAL_TYPE_DISCRETE;
        interval->discrete.numerator = 1;
        interval->discrete.denominator = interval->index ? RATE / 2 : RATE;
        return 0;
    }
    case VIDIOC_G_PARM: {
        struct v4l2_streamparm *parameters = at;
        parameters->parm.capture.timeperframe.numerator = 1;
        parameters->parm.capture.timeperframe.denominator = RATE;
        return 0;
    }
    case VIDIOC_G_FMT:
        return fill_format(camera, at), 0;
    case VIDIOC_S_FMT: {
        int error = set_format(camera, number, at);
        return error ? error : (fill_format(camera, at), 0);
    }
    default:
        return ENOTTY;
    }
}

static int serve(int fd, unsigned long request, void *at) {
    int number = opened[fd] - 1, error;
    Camera *camera = &cameras[number];
    switch (request) {
    case VIDIOC_QUERY_EXT_CTRL: return query_control(at);
    case VIDIOC_G_EXT_CTRLS: return controls(camera, number, at, 0);
    case VIDIOC_S_EXT_CTRLS: return controls(camera, number, at, 1);
    case VIDIOC_REQBUFS:
        error = request_buffers(camera, fd, at);
        return note(number, "REQBUFS %d: %d", camera->count, error), error;
    case VIDIOC_QUERYBUF:
        return note(number, "QUERYBUF %u", ((struct v4l2_buffer *)at)->index), buffer(camera, request, at);
    case VIDIOC_QBUF:
        error = buffer(camera, request, at);
        return note(number, "QBUF %u: %d", ((struct v4l2_buffer *)at)->index, error), error;
    case VIDIOC_DQBUF:
        error = buffer(camera, request, at);
        return note(number, "DQBUF %u: %d", ((struct v4l2_buffer *)at)->index, error), error;
    case VIDIOC_STREAMON:
    case VIDIOC_STREAMOFF:
        error = stream(camera, number, *(int *)at, request == VIDIOC_STREAMON);
        return note(number, "%s: %d", request == VIDIOC_STREAMON ? "STREAMON" : "STREAMOFF", error), error;
    default: return describe(camera, number, request, at);
    }
}

long syscall(long which, ...) {
    static long (*real)(long, ...);
    if (!real) real = dlsym(RTLD_NEXT, "syscall");
    va_list values;
    va_start(values, which);
    long v[6];
    for (int n = 0; n < 6; n++) v[n] = va_arg(values, long);
    va_end(values);
    int fd = (int)v[0];
    if (which != SYS_ioctl || fd < 0 || fd >= (int)sizeof opened || !opened[fd]) return real(which, v[0], v[1], v[2], v[3], v[4], v[5]);
    pthread_mutex_lock(&lock);
    int error = serve(fd, (unsigned long)v[1], (void *)v[2]);
    pthread_mutex_unlock(&lock);
    return error ? (errno = error, -1) : 0;
}
