/* One serial line of the Erlang VM, and the last words on it when the VM can no longer write.
   Started as

       serial --port DEVICE --speed BAUD | --pty LINK   [--last-words HEX] [--keep-alive MS]

   it opens DEVICE raw, 8 data bits, no parity, one stop bit, no flow control, exclusively; or it
   makes a new pseudo-terminal, and the symbolic link LINK to its other end. Packets in both
   directions have a length of two bytes, most significant first, and begin with a letter.
   Incoming:

       'W' at:64 bytes to write
       'K' at:64       a sign of life; 'W' and 'L' are signs of life too
       'L' at:64 bytes the last words from now on
       'T' count:32    this many bytes of 'D' were taken
       'C'             close: writes what waits and then the last words, and answers 'C'

   Outgoing:

       'O' now:64      open; always the first packet, unless that is 'E'
       'K'             'K' was read; sent at most every ANSWER_MS
       'D' bytes       bytes read from the line
       'T' count:32    this many bytes of 'W' were taken by the line, or dropped
       'E' reason      the line cannot be opened, is lost, or has said its last words in silence
                       ("last_words"); only 'C' follows
       'C'             closed, or as good as closed; nothing follows

   The last words are written when the input ends, on SIGTERM and SIGHUP, on 'C', and in silence.
   They do not wait for earlier bytes that would take longer than PATIENCE_MS to leave. Those are
   discarded, maybe amid a packet, so the receiver must be able to find the beginning of the last
   words.

   Silence is MS milliseconds without a sign of life, by any of these: none has come; two that
   follow each other were given so far apart; this program was stopped (SIGSTOP) for so long, and
   nothing could be written; the machine was suspended for so long. Whoever was silent does not
   know what became of the wheels, so the words are the last ones indeed: from the moment that the
   silence is noticed nothing that the VM sends is written any more, and 'E' says so. The VM closes
   the line, and opens it anew.

   Every sign of life has the time when it was given, `at`, in milliseconds of CLOCK_MONOTONIC,
   which the VM reads too. What is older than MS when it could be written is not written, whether it
   waited in the pipe or for the line. A line without last words is lost by no silence. While this
   program is stopped the VM notices that 'K' is not answered.

   After 'E' and 'C' the program waits for its input to end: if it had ended itself, a write of
   the VM could fail, and the VM would see that failure instead of the packet.

   Only the closing and the last words wait, for the times below, and no buffer grows: up to
   SERIAL_OUT_MOST bytes that the line does not take are kept, and while the VM does not read, the
   line is not read either. */
#define _GNU_SOURCE
#include "serial.h"

#include <asm/termbits.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <time.h>
#include <unistd.h>

#define PATIENCE_MS 20      /* bytes that leave within this time may precede the last words */
#define WORDS_MS 200        /* how long the last words are tried to be written */
#define CLOSE_MS 500        /* how long 'C' waits for earlier bytes and the end */
#define FAREWELL_MS 1000    /* how long to stay after SIGTERM, so that the VM hears of it */

#define ANSWER_MS 100       /* between two answers to 'K' */
#define ABSENT_MS 10        /* how often to check whether a pty's other end was opened */
#define SLAVE_MAJOR_FIRST 136
#define SLAVE_MAJOR_LAST 143

static struct {
    const char *device, *link;
    char slave[64];                     /* what the link leads to; empty if none was made */
    unsigned speed;
    int64_t keep_alive_ms;
    int dtr;                            /* 1 to set the line, 0 to clear it, -1 to leave it */
    int fd;                             /* of the line; -1 when it is closed or lost */
    int absent;                         /* the other end of the pty is not open */
    int done;                           /* 'E' or 'C' was sent */
    uint8_t words[SERIAL_WORDS_MOST];
    size_t words_length;
    int64_t life_ms;
    int64_t answer_ms;                  /* when 'K' was answered last */
    int64_t out_ms;                     /* when the VM sent the oldest of `out`, or longer ago */
    int64_t awake_ms;                   /* when this program was known to run */
    int64_t asleep_ms;                  /* how long the machine has been suspended since it was switched on */
    int silent;                         /* a silence was noticed: nothing but the last words is written any more */
    int spoken;                         /* these were, since then */
    uint8_t in[2 + 65535];              /* packets of the VM */
    size_t in_have;
    uint8_t out[SERIAL_OUT_MOST];       /* for the line */
    size_t out_have;
    uint8_t up[8192];                   /* packets to the VM */
    size_t up_have;
    uint32_t unread, taken;
} s;

static volatile sig_atomic_t told_to_end, continued;

static void on_signal(int number)
{
    if (number == SIGCONT)
        continued = 1;
    else
        told_to_end = number;
}

static int64_t now_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

static int leads_to(const char *link, const char *to)
{
    char found[sizeof s.slave];
    ssize_t n = readlink(link, found, sizeof found);

    return n == (ssize_t)strlen(to) && memcmp(found, to, (size_t)n) == 0;
}

/* The link goes first: once the pty is closed, another may get its number, and so the link. */
static void let_go(void)
{
    if (s.slave[0] && leads_to(s.link, s.slave))
        unlink(s.link);
    s.slave[0] = 0;
    if (s.fd >= 0)
        close(s.fd);
    s.fd = -1;
}

static void quit(int status)
{
    let_go();
    _exit(status);
}

/* ---- to the VM ---- */

static void flush_up(void)
{
    while (s.up_have > 0) {
        ssize_t n = write(STDOUT_FILENO, s.up, s.up_have);

        if (n > 0) {
            s.up_have -= (size_t)n;
            memmove(s.up, s.up + n, s.up_have);
        } else if (errno == EAGAIN) {
            return;
        } else if (errno != EINTR) {
            s.up_have = 0;      /* the VM is gone; the end of our input will show it */
        }
    }
}

/* The caller makes sure that there is room. */
static void send_up(char letter, const void *body, size_t size)
{
    uint8_t *at = s.up + s.up_have;

    at[0] = (uint8_t)((size + 1) >> 8);
    at[1] = (uint8_t)(size + 1);
    at[2] = (uint8_t)letter;
    memcpy(at + 3, body, size);
    s.up_have += 3 + size;
    flush_up();
}

static int room_up(size_t size)
{
    return s.up_have + 3 + size <= sizeof s.up;
}

/* Reports once why the line is of no use any more. */
static void report(const char *reason)
{
    if (s.done)
        return;
    s.done = 1;
    if (room_up(strlen(reason)))
        send_up('E', reason, strlen(reason));
}

static void fail(const char *reason)
{
    let_go();
    report(reason);
}

static const char *reason_of(int error)
{
    switch (error) {
    case ENOENT: return "enoent";
    case ENOTDIR: return "enoent";
    case EACCES: return "eacces";
    case EPERM: return "eacces";
    case EBUSY: return "ebusy";
    case EWOULDBLOCK: return "ebusy";
    case EIO: return "eio";
    case ENXIO: return "enxio";
    case ENODEV: return "enodev";
    case ENOTTY: return "enotty";
    case EINVAL: return "einval";
    case EISDIR: return "enotty";
    case EEXIST: return "eexist";
    default: return strerror(error);
    }
}

/* ---- the line ---- */

static void lost(void)
{
    fail("unplugged");
}

static void note_taken(size_t size)
{
    uint8_t count[4];

    s.taken += (uint32_t)size;
    /* Leaves room for a last packet. */
    if (s.taken >= SERIAL_TAKEN_STEP && !s.done && room_up(sizeof count + 128)) {
        for (int k = 0; k < 4; k++)
            count[k] = (uint8_t)(s.taken >> (24 - 8 * k));
        s.taken = 0;
        send_up('T', count, sizeof count);
    }
}

static int other_end_is_open(void)
{
    struct pollfd line = { .fd = s.fd };

    return poll(&line, 1, 0) == 0 || !(line.revents & POLLHUP);
}

static void drop_out(void)
{
    size_t size = s.out_have;

    s.out_have = 0;
    note_taken(size);
}

/* Bytes that waited too long for the line, or while this program was stopped, are old too. */
static void drop_stale(void)
{
    if (s.out_have > 0 && now_ms() - s.out_ms > s.keep_alive_ms)
        drop_out();
}

/* From here on nothing but the last words is written. */
static void hush(void)
{
    if (s.words_length == 0 || s.silent)
        return;
    s.silent = 1;
    drop_out();
}

/* Of a pty, bytes that are already in the other end's buffer of 4 kB stay, as with any line. */
static void flush_line(void)
{
    ioctl(s.fd, TCFLSH, TCOFLUSH);
}

/* When its user has gone, a pty keeps what was not read; the next user must not get it. */
static void look_for_user(void)
{
    int absent = !other_end_is_open();

    if (absent && !s.absent) {
        int other = open(s.slave, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);

        flush_line();
        drop_out();
        if (other >= 0) {
            ioctl(other, TCFLSH, TCIFLUSH);
            close(other);
        }
    }
    s.absent = absent;
}

/* Writes what the line takes now. What is written to a pty with no user is dropped. */
static void write_line(void)
{
    drop_stale();
    if (s.link && s.fd >= 0 && s.out_have > 0)
        look_for_user();
    if (s.absent)
        drop_out();
    while (s.fd >= 0 && s.out_have > 0) {
        ssize_t n = write(s.fd, s.out, s.out_have);

        if (n > 0) {
            s.out_have -= (size_t)n;
            memmove(s.out, s.out + n, s.out_have);
            note_taken((size_t)n);
        } else if (n < 0 && errno == EAGAIN) {
            return;
        } else if (n == 0 || errno != EINTR) {
            lost();
        }
    }
}

/* How long the line needs for the bytes in the kernel. A pty reports that there are none. */
static int64_t held_ms(void)
{
    int bytes = 0;

    if (ioctl(s.fd, TIOCOUTQ, &bytes) != 0 || bytes <= 0)
        return 0;
    return (int64_t)bytes * 10 * 1000 / s.speed + 1;
}

static void speak(void)
{
    size_t said = 0;
    int64_t until = now_ms() + WORDS_MS;
    int flushed = 0;

    if (s.fd < 0 || s.words_length == 0)
        return;
    if (s.link)
        look_for_user();
    if (s.absent)
        return;
    if (s.out_have > 0 || held_ms() > PATIENCE_MS) {
        drop_out();
        flush_line();
        flushed = 1;
    }
    while (said < s.words_length) {
        ssize_t n = write(s.fd, s.words + said, s.words_length - said);

        if (n > 0) {
            said += (size_t)n;
        } else if (n < 0 && errno == EINTR) {
            continue;
        } else if (n < 0 && errno == EAGAIN && !flushed) {
            flush_line();
            flushed = 1;
            said = 0;           /* their beginning may have been discarded too */
        } else if (n < 0 && errno == EAGAIN) {
            struct pollfd line = { .fd = s.fd, .events = POLLOUT };
            int64_t left = until - now_ms();

            if (left <= 0)
                return;
            poll(&line, 1, (int)left);
        } else {
            lost();
            return;
        }
    }
}

static void read_line(void)
{
    uint8_t bytes[4096];
    ssize_t n = read(s.fd, bytes, sizeof bytes);

    if (n > 0) {
        s.unread += (uint32_t)n;
        send_up('D', bytes, (size_t)n);
    } else if (n < 0 && (errno == EAGAIN || errno == EINTR)) {
        return;
    } else if (s.link) {
        look_for_user();
    } else {
        lost();
    }
}

/* ---- opening ---- */

static int make_raw(int fd)
{
    struct termios2 t;

    if (ioctl(fd, TCGETS2, &t) != 0)
        return -1;
    t.c_iflag = IGNBRK | IGNPAR;
    t.c_oflag = 0;
    t.c_lflag = 0;
    t.c_cflag = CS8 | CREAD | CLOCAL | BOTHER;
    t.c_ispeed = t.c_ospeed = s.speed;
    memset(t.c_cc, 0, sizeof t.c_cc);
    t.c_cc[VMIN] = 1;
    if (ioctl(fd, TCSETS2, &t) != 0 || ioctl(fd, TCGETS2, &t) != 0)
        return -1;
    /* Bytes are misread from an error of some 4 %, and the other side has an error too. */
    if ((t.c_cflag & CSIZE) != CS8 ||
        llabs((long long)t.c_ospeed - (long long)s.speed) * 100 > 3LL * s.speed) {
        errno = EINVAL;
        return -1;
    }
    return 0;
}

static const char *open_device(void)
{
    struct stat about;

    s.fd = open(s.device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (s.fd < 0)
        return reason_of(errno);
    if (fstat(s.fd, &about) != 0)
        return reason_of(errno);
    if (!S_ISCHR(about.st_mode) || !isatty(s.fd))
        return errno == EIO ? "eio" : "enotty";
    if (flock(s.fd, LOCK_EX | LOCK_NB) != 0)
        return reason_of(errno);

    /* A pty would stay exclusive for as long as its master lives, and refuse us the next time. */
    unsigned number = major(about.st_rdev);

    if ((number < SLAVE_MAJOR_FIRST || number > SLAVE_MAJOR_LAST) && ioctl(s.fd, TIOCEXCL) != 0)
        return reason_of(errno);
    if (make_raw(s.fd) != 0)
        return errno == EINVAL ? "speed" : reason_of(errno);
    /* A pty has no such line, and needs none. */
    if (s.dtr >= 0) {
        int line = TIOCM_DTR;
        ioctl(s.fd, s.dtr ? TIOCMBIS : TIOCMBIC, &line);
    }
    /* But not the output: it may be the last words of the previous program. */
    ioctl(s.fd, TCFLSH, TCIFLUSH);
    return NULL;
}

static int leads_nowhere(const char *link)
{
    struct stat about;

    return lstat(link, &about) == 0 && S_ISLNK(about.st_mode) && stat(link, &about) != 0 && errno == ENOENT;
}

/* Replaces only a link that leads nowhere, left by a program of this kind that was killed. If its
   number was free, this pty may have it now, and the link already leads to it. */
static const char *make_link(const char *to)
{
    int made = symlink(to, s.link) == 0;

    if (!made && errno != EEXIST)
        return reason_of(errno);
    if (!made && !leads_to(s.link, to)) {
        if (!leads_nowhere(s.link))
            return "eexist";
        if (unlink(s.link) != 0 || symlink(to, s.link) != 0)
            return reason_of(errno);
    }
    strcpy(s.slave, to);
    return NULL;
}

static const char *open_pty(void)
{
    char slave[sizeof s.slave];

    s.fd = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (s.fd < 0 || grantpt(s.fd) != 0 || unlockpt(s.fd) != 0 ||
        ptsname_r(s.fd, slave, sizeof slave) != 0)
        return reason_of(errno);

    /* Opened once, so that the other end counts as closed until somebody opens it. */
    int other = open(slave, O_RDWR | O_NOCTTY | O_CLOEXEC);

    if (other < 0 || make_raw(other) != 0)
        return reason_of(errno);
    close(other);
    s.absent = 1;
    return make_link(slave);
}

/* ---- from the VM ---- */

static int64_t number_64(const uint8_t *bytes)
{
    uint64_t number = 0;

    for (int k = 0; k < 8; k++)
        number = number << 8 | bytes[k];
    return number > INT64_MAX ? INT64_MAX : (int64_t)number;
}

/* Takes a sign of life given at `at`; returns since when it counts. A time in the future counts as now. */
static int64_t alive(int64_t at)
{
    int64_t now = now_ms();

    if (at > now)
        at = now;
    if (at - s.life_ms > s.keep_alive_ms)
        hush();
    if (at > s.life_ms)
        s.life_ms = at;
    return at;
}

static void wait_until_sent(int64_t until)
{
    int64_t held;

    while (s.fd >= 0 && (held = held_ms()) > 0 && now_ms() < until)
        poll(NULL, 0, held < 10 ? (int)held : 10);
}

static void close_line(void)
{
    int64_t until = now_ms() + CLOSE_MS;

    write_line();
    while (s.fd >= 0 && s.out_have > 0 && now_ms() < until) {
        struct pollfd line = { .fd = s.fd, .events = POLLOUT };

        poll(&line, 1, 10);
        write_line();
    }
    speak();
    wait_until_sent(until);
    s.done = 1;
    let_go();
    if (room_up(0))
        send_up('C', "", 0);
}

static void take_packet(const uint8_t *packet, size_t size)
{
    /* A lost line is closed too. */
    if (size == 0 || (s.fd < 0 && packet[0] != 'C'))
        return;
    const uint8_t *body = packet + 1;
    int64_t given_ms = 0;

    size--;
    if (packet[0] == 'W' || packet[0] == 'K' || packet[0] == 'L') {
        if (size < 8)
            return;
        given_ms = alive(number_64(body));
        body += 8;
        size -= 8;
    }
    switch (packet[0]) {
    case 'W':
        if (s.silent || now_ms() - given_ms > s.keep_alive_ms || size > sizeof s.out - s.out_have) {
            note_taken(size);   /* too late, or more than the VM may send */
        } else {
            if (s.out_have == 0)
                s.out_ms = given_ms;
            memcpy(s.out + s.out_have, body, size);
            s.out_have += size;
            write_line();
        }
        break;
    case 'K':
        if (now_ms() - s.answer_ms >= ANSWER_MS && room_up(128)) {
            s.answer_ms = now_ms();
            send_up('K', "", 0);
        }
        break;
    case 'L':
        if (size <= sizeof s.words) {
            memcpy(s.words, body, size);
            s.words_length = size;
        }
        break;
    case 'T':
        if (size == 4) {
            uint32_t count = (uint32_t)body[0] << 24 | (uint32_t)body[1] << 16 |
                             (uint32_t)body[2] << 8 | body[3];

            s.unread -= count < s.unread ? count : s.unread;
        }
        break;
    case 'C':
        close_line();
        break;
    }
}

/* 0 if the input has ended. */
static int read_vm(void)
{
    ssize_t n = read(STDIN_FILENO, s.in + s.in_have, sizeof s.in - s.in_have);
    size_t at = 0;

    if (n < 0 && (errno == EINTR || errno == EAGAIN))
        return 1;
    if (n <= 0)
        return 0;
    s.in_have += (size_t)n;
    while (s.in_have - at >= 2) {
        size_t size = (size_t)s.in[at] << 8 | s.in[at + 1];

        if (s.in_have - at - 2 < size)
            break;
        take_packet(s.in + at + 2, size);
        at += 2 + size;
    }
    s.in_have -= at;
    memmove(s.in, s.in + at, s.in_have);
    return 1;
}

/* ---- the program ---- */

static int hex_digit(char c)
{
    const char *digits = "0123456789ABCDEF", *at = c ? strchr(digits, c) : NULL;

    return at ? (int)(at - digits) : -1;
}

static int parse_words(const char *hex)
{
    size_t length = strlen(hex);

    if (length % 2 != 0 || length / 2 > sizeof s.words)
        return -1;
    for (size_t k = 0; k < length / 2; k++) {
        int high = hex_digit(hex[2 * k]), low = hex_digit(hex[2 * k + 1]);

        if (high < 0 || low < 0)
            return -1;
        s.words[k] = (uint8_t)(high << 4 | low);
    }
    s.words_length = length / 2;
    return 0;
}

static int parse_number(const char *text, long most, long *number)
{
    char *end;

    errno = 0;
    *number = strtol(text, &end, 10);
    return *text != 0 && *end == 0 && errno == 0 && *number >= 1 && *number <= most ? 0 : -1;
}

static int parse(int argc, char **argv)
{
    long number;

    s.speed = 115200;
    s.keep_alive_ms = 200;
    s.dtr = -1;
    if (argc % 2 != 1)
        return -1;
    for (int k = 1; k < argc; k += 2) {
        const char *value = argv[k + 1];

        if (strcmp(argv[k], "--port") == 0) {
            s.device = value;
        } else if (strcmp(argv[k], "--pty") == 0) {
            s.link = value;
        } else if (strcmp(argv[k], "--speed") == 0) {
            if (parse_number(value, INT_MAX, &number) != 0)
                return -1;
            s.speed = (unsigned)number;
        } else if (strcmp(argv[k], "--keep-alive") == 0) {
            if (parse_number(value, INT_MAX, &number) != 0)
                return -1;
            s.keep_alive_ms = number;
        } else if (strcmp(argv[k], "--dtr") == 0) {
            s.dtr = strcmp(value, "on") == 0;
        } else if (strcmp(argv[k], "--last-words") == 0) {
            if (parse_words(value) != 0)
                return -1;
        } else {
            return -1;
        }
    }
    return !s.device != !s.link ? 0 : -1;
}

static void listen_to_signals(sigset_t *while_waiting)
{
    struct sigaction end = { .sa_handler = on_signal };
    sigset_t ours;

    sigemptyset(&ours);
    sigaddset(&ours, SIGTERM);
    sigaddset(&ours, SIGHUP);
    sigaddset(&ours, SIGCONT);
    sigprocmask(SIG_BLOCK, &ours, while_waiting);
    sigdelset(while_waiting, SIGTERM);
    sigdelset(while_waiting, SIGHUP);
    sigdelset(while_waiting, SIGCONT);
    sigaction(SIGCONT, &end, NULL);
    sigaction(SIGTERM, &end, NULL);
    sigaction(SIGHUP, &end, NULL);
    signal(SIGPIPE, SIG_IGN);
    signal(SIGINT, SIG_IGN);    /* a key pressed in the VM's terminal is meant for the VM */
}

/* Until when to wait at most; INT64_MAX: no limit. */
static int64_t next_ms(void)
{
    int64_t at = INT64_MAX;

    if (s.fd >= 0 && s.words_length > 0 && !s.spoken)
        at = s.silent ? now_ms() : s.life_ms + s.keep_alive_ms;
    if (s.fd >= 0 && s.absent && at > now_ms() + ABSENT_MS)
        at = now_ms() + ABSENT_MS;
    return at;
}

static int input_waits(void)
{
    struct pollfd input = { .fd = STDIN_FILENO, .events = POLLIN };

    return poll(&input, 1, 0) > 0;
}

/* How long the machine has been suspended since the last call: CLOCK_MONOTONIC stands meanwhile. Too
   little if this program is stopped between the two clocks, and made up for by the next call. */
static int64_t suspended_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_BOOTTIME, &t);

    int64_t all = (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000 - now_ms();
    int64_t more = all > s.asleep_ms ? all - s.asleep_ms : 0;

    s.asleep_ms += more;
    return more;
}

static int stopped(void)
{
    sigset_t pending;

    return continued || (sigpending(&pending) == 0 && sigismember(&pending, SIGCONT));
}

/* Notices that this program, or the whole machine, has slept so long that the line heard nothing. A
   program that is merely late, on a busy machine, has not: the signs of life that wait for it count
   from when they were given. */
static void wake(void)
{
    if (suspended_ms() > s.keep_alive_ms || (stopped() && now_ms() - s.awake_ms > s.keep_alive_ms))
        hush();
    continued = 0;
    s.awake_ms = now_ms();
}

/* Says the last words once, after all that has come by now, as newer last words may have. */
static void speak_in_silence(void)
{
    if (!s.silent || s.spoken || s.fd < 0)
        return;
    s.spoken = 1;
    speak();
    report("last_words");
}

/* Waits for the next events, and handles them. 0 if the VM is gone. */
static int turn(const sigset_t *while_waiting)
{
    int64_t at = next_ms(), left = at - now_ms();
    struct timespec timeout = { 0 };

    if (at != INT64_MAX && left > 0) {
        timeout.tv_sec = left / 1000;
        timeout.tv_nsec = left % 1000 * 1000000;
    }
    /* Data is read only into an empty buffer, so that there is always room for a last packet. */
    int reading = s.up_have == 0 && s.unread < SERIAL_UNREAD_MOST && !s.done;
    short wishes = (short)((reading ? POLLIN : 0) | (s.out_have > 0 ? POLLOUT : 0));
    struct pollfd fds[3] = {
        { .fd = STDIN_FILENO, .events = POLLIN },
        { .fd = s.absent ? -1 : s.fd, .events = wishes },
        { .fd = s.up_have > 0 ? STDOUT_FILENO : -1, .events = POLLOUT },
    };

    int found = ppoll(fds, 3, at == INT64_MAX ? NULL : &timeout, while_waiting), interrupted = errno == EINTR;

    wake();
    drop_stale();
    if (found < 0)
        return interrupted;
    if (fds[0].revents && !read_vm())
        return 0;
    if (fds[2].revents)
        flush_up();
    note_taken(0);
    if (s.fd >= 0 && s.absent) {
        look_for_user();
        if (reading && s.up_have == 0)
            read_line();        /* what the last user wrote before it closed */
    }
    if (s.fd >= 0 && (fds[1].revents & POLLOUT))
        write_line();
    if (s.fd >= 0 && (fds[1].revents & (POLLIN | POLLHUP | POLLERR))) {
        if (reading && s.up_have == 0)
            read_line();
        else if (fds[1].revents & (POLLHUP | POLLERR))
            s.link ? look_for_user() : lost();
    }
    /* Last, and after another look, so that a sign of life that waits in the input counts: on a
       busy machine this program may be late, not the VM. */
    if (!s.silent && now_ms() >= s.life_ms + s.keep_alive_ms && !input_waits())
        hush();
    wake();
    speak_in_silence();
    return 1;
}

int serial_run(int argc, char **argv)
{
    sigset_t while_waiting;
    const char *reason;

    s.fd = -1;
    if (parse(argc, argv) != 0) {
        fprintf(stderr, "usage: serial --port DEVICE | --pty LINK  [--speed BAUD] [--last-words HEX]"
                        " [--keep-alive MS]\n");
        return 2;
    }
    listen_to_signals(&while_waiting);
    /* Little to do, but without delay on a busy machine. Needs root, or LimitNICE. */
    (void)setpriority(PRIO_PROCESS, 0, -10);
    fcntl(STDOUT_FILENO, F_SETFL, fcntl(STDOUT_FILENO, F_GETFL) | O_NONBLOCK);
    reason = s.link ? open_pty() : open_device();
    if (reason) {
        fail(reason);
    } else {
        uint8_t now[8];
        int64_t at = now_ms();

        for (int k = 0; k < 8; k++)
            now[k] = (uint8_t)(at >> (56 - 8 * k));
        send_up('O', now, sizeof now);
        s.life_ms = s.awake_ms = at;
        suspended_ms();
        s.answer_ms = at - ANSWER_MS;
    }
    while (!told_to_end)
        if (!turn(&while_waiting)) {
            speak();
            quit(0);
        }
    speak();
    fail("terminated");
    for (int64_t until = now_ms() + FAREWELL_MS; now_ms() < until;) {
        struct pollfd input = { .fd = STDIN_FILENO, .events = POLLIN };

        if (poll(&input, 1, 10) > 0 && !read_vm())
            break;
        flush_up();
    }
    quit(128 + told_to_end);
    return 0;
}
