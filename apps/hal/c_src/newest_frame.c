/* Stands between ffmpeg and the Erlang VM, because an Erlang port has no back-pressure: what is
   not read piles up in the VM. Started as

       newest_frame newest|every PROGRAM ARGUMENT...

   it runs PROGRAM, reads its yuv4mpeg stream, and keeps one finished picture: the newest or, with
   `every`, each one in turn, while PROGRAM waits. Packets in both directions have a length of
   four bytes, most significant first. Each incoming packet, whatever its content, is the credit
   for one picture. Outgoing packets are pictures,

       'F' chroma:8 width:32 height:32 rate:32 per:32 number:64 age_us:64 bytes

   (chroma 0: i420, 1: yuyv; the number counts all pictures from 0, dropped ones too), a change of
   the source's size, which ffmpeg would hide by scaling,

       'S' old_width:32 old_height:32 width:32 height:32

   and, once, the end: 'E' status:8 pictures:64 and the end of what PROGRAM complained of.

   PROGRAM writes each line of its standard error with its level (ffmpeg -loglevel level+info): the
   sizes of its filter showinfo, and errors, are read; all other lines are dropped.

   PROGRAM ends with this program, and this program with its standard input, so nothing outlives
   the VM. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "y4m.h"

#define LONGEST_LINE 256
#define LONGEST_WORDS 512
#define STATUS_NOT_RUN 127      /* as in shells */
#define STATUS_NOT_UNDERSTOOD 255

enum phase { HEADER, FRAME, PLANES, ENDED };

struct picture {
    uint8_t *bytes;
    uint64_t number;
    int64_t at_us;
};

static struct {
    int every;
    pid_t child;
    int pictures_fd, words_fd;  /* PROGRAM's output and errors; -1 when closed */
    enum phase phase;
    struct y4m header;
    char line[LONGEST_LINE];
    size_t line_length;
    struct picture back, front; /* being filled; finished */
    size_t size, filled;
    int fresh;                  /* front was not sent yet */
    uint8_t *yuyv;
    uint64_t count, credit;
    uint8_t credit_head[4];     /* of the incoming packet */
    uint32_t credit_have, credit_skip;
    char words[LONGEST_WORDS];
    size_t words_length;
    char said[LONGEST_WORDS];   /* the line of PROGRAM's errors that has only begun */
    size_t said_length;
    uint32_t width, height;     /* of the source; 0 before the first picture */
    int not_understood;
} s = { .pictures_fd = -1, .words_fd = -1 };

static int64_t now_us(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000;
}

static void leave(int status)
{
    if (s.child > 0)
        kill(s.child, SIGKILL);
    _exit(status);
}

static void write_all(const void *from, size_t size)
{
    const uint8_t *at = from;

    while (size > 0) {
        ssize_t n = write(STDOUT_FILENO, at, size);

        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            leave(1);           /* the VM is gone */
        at += n;
        size -= (size_t)n;
    }
}

static uint8_t *put(uint8_t *at, uint64_t value, int bytes)
{
    for (int k = bytes - 1; k >= 0; k--)
        *at++ = (uint8_t)(value >> 8 * k);
    return at;
}

static void send_packet(const uint8_t *head, size_t head_size, const void *body, size_t body_size)
{
    uint8_t length[4];

    put(length, head_size + body_size, 4);
    write_all(length, sizeof length);
    write_all(head, head_size);
    write_all(body, body_size);
}

static void send_front(void)
{
    uint8_t head[64], *at = head;
    const uint8_t *bytes = s.front.bytes;

    *at++ = 'F';
    at = put(at, s.header.chroma, 1);
    at = put(at, s.header.width, 4);
    at = put(at, s.header.height, 4);
    at = put(at, s.header.rate, 4);
    at = put(at, s.header.per, 4);
    at = put(at, s.front.number, 8);
    if (s.header.chroma == Y4M_422) {
        y4m_yuyv(&s.header, bytes, s.yuyv);
        bytes = s.yuyv;
    }
    at = put(at, (uint64_t)(now_us() - s.front.at_us), 8);
    send_packet(head, (size_t)(at - head), bytes, s.size);
    s.fresh = 0;
    s.credit--;
}

static void send_end(int wait_status)
{
    uint8_t head[16], *at = head;
    int status = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);

    *at++ = 'E';
    at = put(at, (uint64_t)(s.not_understood ? STATUS_NOT_UNDERSTOOD : status), 1);
    at = put(at, s.count, 8);
    send_packet(head, (size_t)(at - head), s.words, s.words_length);
}

static void start(char **command)
{
    int pictures[2], words[2];
    pid_t parent = getpid();

    if (pipe2(pictures, O_CLOEXEC) != 0 || pipe2(words, O_CLOEXEC) != 0)
        leave(1);
    s.child = fork();
    if (s.child < 0)
        leave(1);
    if (s.child == 0) {
        int nothing = open("/dev/null", O_RDONLY);

        prctl(PR_SET_PDEATHSIG, SIGKILL);
        signal(SIGPIPE, SIG_DFL);
        if (getppid() != parent || nothing < 0 || dup2(nothing, STDIN_FILENO) < 0 ||
            dup2(pictures[1], STDOUT_FILENO) < 0 || dup2(words[1], STDERR_FILENO) < 0)
            _exit(STATUS_NOT_RUN);
        execvp(command[0], command);
        _exit(STATUS_NOT_RUN);
    }
    close(pictures[1]);
    close(words[1]);
    s.pictures_fd = pictures[0];
    s.words_fd = words[0];
}

static void stop_reading(int not_understood)
{
    close(s.pictures_fd);
    s.pictures_fd = -1;
    s.phase = ENDED;
    s.not_understood = not_understood;
    if (not_understood)
        kill(s.child, SIGKILL);
}

static void end_of_line(void)
{
    if (s.phase == FRAME) {
        if (s.line_length < 5 || memcmp(s.line, "FRAME", 5) != 0) {
            stop_reading(1);
            return;
        }
    } else {
        if (y4m_header(s.line, s.line_length, &s.header) != 0) {
            stop_reading(1);
            return;
        }
        s.size = y4m_size(&s.header);
        s.back.bytes = malloc(s.size);
        s.front.bytes = malloc(s.size);
        s.yuyv = malloc(s.size);
        if (!s.back.bytes || !s.front.bytes || !s.yuyv)
            leave(1);
    }
    s.phase = s.phase == HEADER ? FRAME : PLANES;
    s.line_length = s.filled = 0;
}

/* Reads what is there: one byte at a time in a line, so as not to read into the planes. */
static void read_pictures(void)
{
    char letter;
    int in_planes = s.phase == PLANES;
    ssize_t n = in_planes ? read(s.pictures_fd, s.back.bytes + s.filled, s.size - s.filled)
                          : read(s.pictures_fd, &letter, 1);

    if (n < 0 && errno == EINTR)
        return;
    if (n <= 0) {
        stop_reading(0);
    } else if (in_planes) {
        s.filled += (size_t)n;
    } else if (letter == '\n') {
        end_of_line();
    } else if (s.line_length == LONGEST_LINE) {
        stop_reading(1);
    } else {
        s.line[s.line_length++] = letter;
    }
}

static int back_is_full(void)
{
    return s.phase == PLANES && s.filled == s.size;
}

static void turn_over(void)
{
    uint8_t *bytes = s.front.bytes;

    s.front = (struct picture){ s.back.bytes, s.count++, now_us() };
    s.back.bytes = bytes;
    s.fresh = 1;
    s.phase = FRAME;
}

/* Keeps the end of what PROGRAM complains of. */
static void keep_words(const char *words, size_t n)
{
    size_t most = sizeof s.words - n;

    if (s.words_length > most) {
        memmove(s.words, s.words + s.words_length - most, most);
        s.words_length = most;
    }
    memcpy(s.words + s.words_length, words, n);
    s.words_length += n;
}

/* The source's size in a line of showinfo, "... s:640x360 ..."; 0 if there is none. */
static int size_in(const char *line, uint32_t *width, uint32_t *height)
{
    const char *at = strstr(line, " s:");
    char *end;

    if (!strstr(line, "showinfo") || !at)
        return 0;
    *width = (uint32_t)strtoul(at + 3, &end, 10);
    if (*end != 'x')
        return 0;
    *height = (uint32_t)strtoul(end + 1, &end, 10);
    return *width > 0 && *height > 0 && *end == ' ';
}

static void note_size(uint32_t width, uint32_t height)
{
    uint8_t head[32], *at = head;

    if (s.width > 0 && (width != s.width || height != s.height)) {
        *at++ = 'S';
        at = put(at, s.width, 4);
        at = put(at, s.height, 4);
        at = put(at, width, 4);
        at = put(at, height, 4);
        send_packet(head, (size_t)(at - head), NULL, 0);
    }
    s.width = width;
    s.height = height;
}

/* A whole line; it ends with its line end and a zero. */
static void end_of_words(char *line, size_t length)
{
    static const char *const levels[] = { "[error] ", "[fatal] ", "[panic] " };
    uint32_t width, height;

    for (size_t k = 0; k < sizeof levels / sizeof *levels; k++) {
        char *level = strstr(line, levels[k]);

        if (level) {
            size_t size = strlen(levels[k]), before = (size_t)(level - line);

            memmove(level, level + size, length - before - size);
            keep_words(line, length - size);
            return;
        }
    }
    if (size_in(line, &width, &height))
        note_size(width, height);
}

static void read_words(void)
{
    char words[256];
    ssize_t n = read(s.words_fd, words, sizeof words);

    if (n < 0 && errno == EINTR)
        return;
    if (n <= 0) {
        close(s.words_fd);
        s.words_fd = -1;
        words[0] = '\n';
        n = 1;
    }
    /* Of a line that is too long the beginning counts. */
    for (ssize_t k = 0; k < n; k++) {
        if (words[k] != 0 && (words[k] == '\n' || s.said_length < sizeof s.said - 2))
            s.said[s.said_length++] = words[k];
        if (words[k] == '\n') {
            s.said[s.said_length] = 0;
            end_of_words(s.said, s.said_length);
            s.said_length = 0;
        }
    }
}

static void read_credit(void)
{
    uint8_t bytes[256];
    ssize_t n = read(STDIN_FILENO, bytes, sizeof bytes);

    if (n < 0 && errno == EINTR)
        return;
    if (n <= 0)
        leave(0);
    for (ssize_t k = 0; k < n; k++) {
        if (s.credit_have < 4) {
            s.credit_head[s.credit_have++] = bytes[k];
            if (s.credit_have < 4)
                continue;
            s.credit_skip = (uint32_t)s.credit_head[0] << 24 | (uint32_t)s.credit_head[1] << 16 |
                            (uint32_t)s.credit_head[2] << 8 | s.credit_head[3];
        } else {
            s.credit_skip--;
        }
        if (s.credit_skip == 0) {
            s.credit++;
            s.credit_have = 0;
        }
    }
}

/* Waits for the child, and meanwhile for the end of our input. */
static int child_status(void)
{
    int status = 0;

    while (waitpid(s.child, &status, WNOHANG) == 0) {
        struct pollfd input = { .fd = STDIN_FILENO, .events = POLLIN };

        if (poll(&input, 1, 5) > 0)
            read_credit();
    }
    s.child = 0;
    return status;
}

int main(int argc, char **argv)
{
    if (argc < 3 || (strcmp(argv[1], "newest") != 0 && strcmp(argv[1], "every") != 0))
        return 2;
    s.every = argv[1][0] == 'e';
    signal(SIGPIPE, SIG_IGN);
    start(argv + 2);

    for (;;) {
        struct pollfd fds[3] = {
            { .fd = STDIN_FILENO, .events = POLLIN },
            { .fd = back_is_full() ? -1 : s.pictures_fd, .events = POLLIN },
            { .fd = s.words_fd, .events = POLLIN },
        };

        if (poll(fds, 3, -1) < 0 && errno != EINTR)
            leave(1);
        if (fds[0].revents)
            read_credit();
        if (fds[1].revents)
            read_pictures();
        if (fds[2].revents)
            read_words();
        if (back_is_full() && !(s.every && s.fresh))
            turn_over();
        if (s.fresh && s.credit > 0)
            send_front();
        if (s.phase == ENDED && !s.fresh && s.words_fd < 0)
            break;
    }
    send_end(child_status());
    /* A credit may be on its way. If this program had ended, the VM's write of it would fail,
       and the VM could miss the packet 'E'. It closes our input when it has read that. */
    for (;;)
        read_credit();
}
