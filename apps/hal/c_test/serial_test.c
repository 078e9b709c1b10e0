// sources: ../c_src/serial.c
/* The serial port program in a child, between pipes as the VM has them and a pseudo-terminal of ours,
   under sanitizers: what is wrong on the command line and in its input, floods from both sides, and
   its last words after each way to end. */
#define _GNU_SOURCE
#include <asm/termbits.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "serial.h"

#define STOP "\033STOP\r"
#define STOP_HEX "1B53544F500D"

static struct {
    pid_t pid;
    int in, out;                /* of the child */
    int master;
    char slave[64];
} t;

static void check(int right, const char *what)
{
    if (!right) {
        fprintf(stderr, "serial_test: %s\n", what);
        exit(1);
    }
}

/* For how long the machine seems to have been suspended; shared with the child. */
static volatile int64_t *suspended_s;

/* In the place of the C library's, here and in the program. */
int clock_gettime(clockid_t clock, struct timespec *at)
{
    int result = (int)syscall(SYS_clock_gettime, clock, at);

    if (clock == CLOCK_BOOTTIME)
        at->tv_sec += *suspended_s;
    return result;
}

static int64_t now_ms(void)
{
    struct timespec at;

    clock_gettime(CLOCK_MONOTONIC, &at);
    return (int64_t)at.tv_sec * 1000 + at.tv_nsec / 1000000;
}

static void start(char **argv)
{
    int in[2], out[2], argc = 0;

    check(pipe2(in, O_CLOEXEC) == 0 && pipe2(out, O_CLOEXEC) == 0, "no pipes");
    while (argv[argc])
        argc++;
    t.pid = fork();
    check(t.pid >= 0, "no child");
    if (t.pid == 0) {
        dup2(in[0], 0);
        dup2(out[1], 1);
        close(in[0]);
        close(in[1]);
        close(out[0]);
        close(out[1]);
        close(t.master);
        alarm(20);
        exit(serial_run(argc, argv));
    }
    close(in[0]);
    close(out[1]);
    t.in = in[1];
    t.out = out[0];
}

/* Of the child, which must not have been ended by a sanitizer (1) or a hang (SIGALRM). */
static int status(void)
{
    int status;

    check(waitpid(t.pid, &status, 0) == t.pid, "no child to wait for");
    check(WIFEXITED(status), "the program was ended by a signal");
    return WEXITSTATUS(status);
}

static void end_input(void)
{
    close(t.in);
    t.in = -1;
}

static int finish(void)
{
    if (t.in >= 0)
        end_input();

    int found = status();

    close(t.out);
    return found;
}

static void send_packet(char letter, const void *body, size_t size)
{
    size_t stamp = letter == 'W' || letter == 'K' || letter == 'L' ? 8 : 0;
    uint8_t head[11] = { (uint8_t)((size + stamp + 1) >> 8), (uint8_t)(size + stamp + 1), (uint8_t)letter };
    int64_t at = now_ms();

    for (int k = 0; k < 8; k++)
        head[3 + k] = (uint8_t)(at >> (56 - 8 * k));
    check(write(t.in, head, 3 + stamp) == (ssize_t)(3 + stamp), "a packet's head was not taken");
    check(size == 0 || write(t.in, body, size) == (ssize_t)size, "a packet was not taken");
}

static void read_exactly(int fd, void *to, size_t size)
{
    size_t at = 0;
    int64_t until = now_ms() + 5000;

    while (at < size) {
        struct pollfd from = { .fd = fd, .events = POLLIN };

        check(poll(&from, 1, (int)(until - now_ms())) > 0, "nothing came");
        ssize_t n = read(fd, (char *)to + at, size - at);

        check(n > 0, "the end came before what was to come");
        at += (size_t)n;
    }
}

/* The next packet's letter; its body as text. */
static char packet(char *body, size_t most)
{
    uint8_t head[3];

    read_exactly(t.out, head, 3);
    size_t size = ((size_t)head[0] << 8 | head[1]) - 1;

    check(size < most, "a long packet");
    read_exactly(t.out, body, size);
    body[size] = 0;
    return (char)head[2];
}

static void expect(char letter, const char *body)
{
    char found[8192];
    char found_letter = packet(found, sizeof found);

    if (found_letter != letter || strcmp(found, body) != 0) {
        fprintf(stderr, "serial_test: '%c' \"%s\" and not '%c' \"%s\"\n", found_letter, found, letter, body);
        exit(1);
    }
}

static void open_master(void)
{
    t.master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    check(t.master >= 0 && grantpt(t.master) == 0 && unlockpt(t.master) == 0 &&
          ptsname_r(t.master, t.slave, sizeof t.slave) == 0, "no pty");
}

static void start_on_pty(char *keep_alive)
{
    char *argv[] = { "serial", "--port", t.slave, "--speed", "9600", "--last-words", STOP_HEX,
                     "--keep-alive", keep_alive, NULL };

    open_master();
    start(argv);
    expect('O', "");
}

static void expect_stop(void)
{
    char words[7] = { 0 };

    read_exactly(t.master, words, 6);
    check(memcmp(words, STOP, 6) == 0, "other last words");
}

/* All that came on the line that is closed by now. */
static size_t read_all(char *to, size_t most)
{
    size_t size = 0;
    ssize_t n;

    while ((n = read(t.master, to + size, most - size)) > 0)
        size += (size_t)n;
    check(n < 0 && errno == EIO, "too much came");
    return size;
}

static void command_line(void)
{
    char *wrong[][8] = {
        { "serial" }, { "serial", "--port" }, { "serial", "--speed", "9600" }, { "serial", "--what", "x" },
        { "serial", "--port", "a", "--pty", "b" }, { "serial", "--port", "a", "--speed", "0" },
        { "serial", "--port", "a", "--speed", "-1" }, { "serial", "--port", "a", "--speed", "" },
        { "serial", "--port", "a", "--speed", "9600x" }, { "serial", "--port", "a", "--speed", "99999999999" },
        { "serial", "--port", "a", "--keep-alive", "99999999999999999999" },
        { "serial", "--port", "a", "--last-words", "1" }, { "serial", "--port", "a", "--last-words", "1x" },
        { "serial", "--port", "a", "--last-words", "1B2" },
    };
    int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC), kept = dup(2);
    char words[2 * SERIAL_WORDS_MOST + 3];

    t.master = -1;
    dup2(nothing, 2);
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        start(wrong[k]);
        int found = finish();

        if (found != 2)
            dup2(kept, 2);
        check(found == 2, "a wrong command line was taken");
    }
    memset(words, 'A', sizeof words);
    words[sizeof words - 1] = 0;
    start((char *[]){ "serial", "--port", "a", "--last-words", words, NULL });
    int found = finish();

    dup2(kept, 2);
    close(kept);
    close(nothing);
    check(found == 2, "too long last words were taken");

    start((char *[]){ "serial", "--port", "/no/such/device", NULL });
    expect('E', "enoent");
    send_packet('W', "x", 1);
    send_packet('C', "", 0);
    expect('C', "");
    check(finish() == 0, "a failed opening did not end well");
    start((char *[]){ "serial", "--port", "/dev/null", NULL });
    expect('E', "enotty");
    check(finish() == 0, "a failed opening did not end well");
}

static void ways_to_end(void)
{
    char *ways[] = { "input", "term", "hup", "close", "silence", "full" };

    for (size_t k = 0; k < sizeof ways / sizeof *ways; k++) {
        int way = ways[k][0], expected = 0;

        start_on_pty(way == 's' ? "30" : "100000");
        send_packet('W', "go", 2);
        char go[2];

        read_exactly(t.master, go, 2);
        if (way == 'f') {
            char much[1000];

            memset(much, 'x', sizeof much);
            for (int n = 0; n < 200; n++)   /* more than the kernel and the program keep */
                send_packet('W', much, sizeof much);
        }
        if (way == 't' || way == 'h')
            kill(t.pid, way == 't' ? SIGTERM : SIGHUP);
        if (way == 'c')
            send_packet('C', "", 0);
        if (way == 'i' || way == 'f')
            end_input();
        if (way == 'f') {
            /* Once it has ended, all is said; most was thrown away, less what our side had got already. */
            check(status() == 0, "a full line");
            close(t.out);
            static char said[65536];
            size_t size = read_all(said, sizeof said);

            check(size >= 6 && memcmp(said + size - 6, STOP, 6) == 0, "not its last words");
            check(size < 4096 + 6, "much was said before the last words");
        } else {
            expect_stop();
        }
        if (way == 't' || way == 'h') {
            expect('E', "terminated");
            expected = 128 + (way == 't' ? SIGTERM : SIGHUP);
        }
        if (way == 'c')
            expect('C', "");
        if (way != 'f')
            check(finish() == expected, ways[k]);
        close(t.master);
    }
}

static void pause_ms(int64_t ms)
{
    for (int64_t until = now_ms() + ms; now_ms() < until;)
        usleep(1000);
}

static void freeze(void)
{
    int found;

    kill(t.pid, SIGSTOP);
    check(waitpid(t.pid, &found, WUNTRACED) == t.pid && WIFSTOPPED(found), "it does not stop");
}

/* After a silence: the last words, and nothing of what is sent then or was sent before. */
static void expect_lost(void)
{
    char found[1024], letter;

    expect_stop();
    /* What was read before may have been answered. */
    while ((letter = packet(found, sizeof found)) == 'K' || letter == 'T')
        ;
    check(letter == 'E' && strcmp(found, "last_words") == 0, "the loss of the line is not told");
    send_packet('W', "more", 4);
    send_packet('K', "", 0);
    send_packet('C', "", 0);
    while ((letter = packet(found, sizeof found)) == 'K' || letter == 'T')
        ;
    check(letter == 'C', "it does not close");
    check(finish() == 0, "lost in silence");

    size_t size = read_all(found, sizeof found);

    check(size == 6 && memcmp(found, STOP, 6) == 0, "more than the last words was written");
    close(t.master);
}

/* The VM says nothing for a while, and then goes on. */
static void silence(void)
{
    start_on_pty("100");
    send_packet('W', "go", 2);
    char go[2];

    read_exactly(t.master, go, 2);
    pause_ms(150);
    send_packet('W', "late", 4);
    expect_lost();
}

/* The machine sleeps, so that nobody's clock of signs of life goes on. */
static void suspended(void)
{
    start_on_pty("5000");
    send_packet('K', "", 0);
    expect('K', "");
    *suspended_s += 10;
    send_packet('W', "late", 4);
    expect_lost();

    /* Too short to matter. */
    *suspended_s += 2;
    start_on_pty("5000");
    *suspended_s += 2;
    send_packet('W', "go", 2);
    char go[2];

    read_exactly(t.master, go, 2);
    check(memcmp(go, "go", 2) == 0 && finish() == 0, "a short sleep");
    expect_stop();
    close(t.master);
}

/* Program and VM sleep together, and nobody tells the program, as in a container that is frozen. */
static void frozen_together(void)
{
    int found;

    start_on_pty("200");
    send_packet('K', "", 0);
    expect('K', "");
    if (ptrace(PTRACE_SEIZE, t.pid, NULL, NULL) != 0) {
        fprintf(stderr, "serial_test: no ptrace here: not tested how it sleeps together with the VM\n");
        check(finish() == 0, "no ptrace");
        close(t.master);
        return;
    }
    check(ptrace(PTRACE_INTERRUPT, t.pid, NULL, NULL) == 0, "it does not stop");
    check(waitpid(t.pid, &found, 0) == t.pid && WIFSTOPPED(found), "it does not stop");
    send_packet('W', "old", 3);
    pause_ms(300);
    send_packet('W', "late", 4);
    check(ptrace(PTRACE_DETACH, t.pid, NULL, NULL) == 0, "it does not go on");
    expect_lost();
}

/* Writes so much that some waits in the program; how much was taken by the line by then. */
static size_t fill_line(void)
{
    static char much[1000];
    char found[1024];
    size_t sent = 0, taken = 0;

    memset(much, 'x', sizeof much);
    while (sent < taken + 5000) {
        struct pollfd from = { .fd = t.out, .events = POLLIN };

        send_packet('W', much, sizeof much);
        sent += sizeof much;
        while (poll(&from, 1, 5) > 0) {
            check(packet(found, sizeof found) == 'T', "something else than what was taken");
            taken += (size_t)(uint8_t)found[2] << 8 | (uint8_t)found[3];
        }
    }
    return taken;
}

/* How much comes on the line before this, which comes last. */
static size_t size_before(const char *ending)
{
    char last[3] = { 0 };
    size_t size = 0;

    while (size < 3 || memcmp(last, ending, 3) != 0) {
        memmove(last, last + 1, 2);
        read_exactly(t.master, last + 2, 1);
        size++;
    }
    return size - 3;
}

/* Only the program is frozen, while the VM goes on. */
static void frozen(void)
{
    char found[1024];
    size_t taken;

    /* What is said meanwhile is old when it goes on, and what is new comes too late: nothing could be said to the
       wheels for so long. */
    start_on_pty("500");
    freeze();
    for (int k = 0; k < 8; k++) {
        send_packet('W', "old", 3);
        send_packet('K', "", 0);
        pause_ms(100);
    }
    send_packet('W', "new", 3);
    kill(t.pid, SIGCONT);
    expect_lost();

    /* Frozen for a shorter time, it goes on. */
    start_on_pty("2000");
    freeze();
    send_packet('W', "new", 3);
    kill(t.pid, SIGCONT);
    read_exactly(t.master, found, 3);
    check(memcmp(found, "new", 3) == 0 && finish() == 0, "frozen for a moment");
    expect_stop();
    close(t.master);

    /* New last words are never too old, nor is the end of the VM. */
    start_on_pty("200");
    freeze();
    send_packet('W', "old", 3);
    send_packet('L', "HALT", 4);
    end_input();
    pause_ms(300);
    kill(t.pid, SIGCONT);
    read_exactly(t.master, found, 4);
    check(memcmp(found, "HALT", 4) == 0, "not the newest last words");
    check(finish() == 0, "frozen at its end");
    close(t.master);

    /* What the line had not taken is old too. */
    start_on_pty("200");
    taken = fill_line();
    freeze();
    pause_ms(300);
    kill(t.pid, SIGCONT);
    /* It tells of 1024 at a time. */
    check(size_before("STO") < taken + 1024, "what waited for the line was written after the freeze");
    check(finish() == 0, "frozen with a full line");
    close(t.master);
}

/* What the line does not take in time, while all are well, is too old as well. */
static void slow_line(void)
{
    size_t taken;

    start_on_pty("300");
    taken = fill_line();
    for (int k = 0; k < 10; k++) {
        pause_ms(40);
        send_packet('K', "", 0);
    }
    send_packet('W', "new", 3);
    /* Nobody reads before that. */
    pause_ms(20);
    check(size_before("new") < taken + 1024, "what waited for the line was written too late");
    check(finish() == 0, "a slow line");
    close(t.master);
}

static void unplugged(void)
{
    start_on_pty("100000");
    close(t.master);
    expect('E', "unplugged");
    check(finish() == 0, "unplugged");
    t.master = -1;
}

static void busy(void)
{
    start_on_pty("100000");
    int other = open(t.slave, O_RDWR | O_NOCTTY | O_CLOEXEC);

    check(other >= 0 && flock(other, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK, "it holds no lock");
    check(finish() == 0, "busy");
    expect_stop();
    start((char *[]){ "serial", "--port", t.slave, NULL });
    expect('O', "");
    check(finish() == 0, "the lock outlived its owner");
    close(other);
    close(t.master);
}

/* The settings, as the other side of the pty sees them. */
static void settings(void)
{
    struct termios2 found;

    start_on_pty("100000");
    check(ioctl(t.master, TCGETS2, &found) == 0, "no settings");
    check(found.c_ispeed == 9600 && found.c_ospeed == 9600, "another speed");
    check((found.c_cflag & (CSIZE | PARENB | CSTOPB | CRTSCTS | CLOCAL | CREAD)) == (CS8 | CLOCAL | CREAD),
          "not 8N1 without flow control");
    check(!(found.c_iflag & (IXON | IXOFF | ICRNL | ISTRIP)) && !(found.c_oflag & OPOST) &&
          !(found.c_lflag & (ICANON | ECHO | ISIG)), "not raw");
    check(finish() == 0, "settings");
    close(t.master);
}

static void random_bytes(uint8_t *to, size_t size)
{
    for (size_t k = 0; k < size; k++)
        to[k] = (uint8_t)rand();
}

/* Takes what it says, and remembers the last three bytes of all that: what its last packet was. */
static void drain(uint8_t last[3])
{
    uint8_t bytes[4096];
    ssize_t size;

    while ((size = read(t.out, bytes, sizeof bytes)) > 0)
        for (ssize_t k = size > 3 ? size - 3 : 0; k < size; k++) {
            last[0] = last[1];
            last[1] = last[2];
            last[2] = bytes[k];
        }
}

/* Whether it says, within 2 s, that it was told to close. */
static int closed(uint8_t last[3])
{
    for (int64_t until = now_ms() + 2000; now_ms() < until; usleep(1000)) {
        drain(last);
        if (last[0] == 0 && last[1] == 1 && last[2] == 'C')
            return 1;
    }
    return 0;
}

/* Anything from the VM's side and the line's, in pieces of any size, read by nobody or by somebody. */
static void junk(int seed)
{
    static uint8_t bytes[70000];
    /* Soon silent, or never. */
    char *keep_alive = seed % 5 ? "100000" : "1";
    char *pty[] = { "serial", "--pty", "serial_test_link", "--last-words", STOP_HEX, "--keep-alive", keep_alive, NULL };
    uint8_t last[3] = { 0 };
    int line, reading = seed / 2 % 2;

    srand((unsigned)seed);
    if (seed % 2) {
        t.master = -1;
        unlink(pty[2]);
        start(pty);
        expect('O', "");
        line = open(pty[2], O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
        check(line >= 0, "the link leads nowhere");
    } else {
        start_on_pty(keep_alive);
        line = t.master;
    }
    fcntl(line, F_SETFL, O_NONBLOCK);
    fcntl(t.in, F_SETFL, O_NONBLOCK);
    fcntl(t.out, F_SETFL, O_NONBLOCK);
    for (int k = 0; k < 60; k++) {
        size_t size = (size_t)(rand() % (rand() % 8 ? 300 : (int)sizeof bytes));

        random_bytes(bytes, size);
        /* Half of it packets whose length is right, with letters that mean something. */
        if (size > 3 && size < 60000 && rand() % 2) {
            bytes[0] = (uint8_t)((size - 2) >> 8);
            bytes[1] = (uint8_t)(size - 2);
            bytes[2] = (uint8_t)"WWWWKLTC"[rand() % (seed % 3 ? 7 : 8)];
        }
        if (write(t.in, bytes, size) < 0)
            check(errno == EAGAIN, "the input was closed");
        random_bytes(bytes, 2000);
        if (write(line, bytes, (size_t)(rand() % 2000)) < 0 && errno != EIO)
            check(errno == EAGAIN || seed % 3 == 0, "the line was closed");
        if (reading) {
            while (read(line, bytes, sizeof bytes) > 0)
                ;
            drain(last);
        }
        if (seed % 2 && rand() % 10 == 0) {     /* the user of the pty comes and goes */
            close(line);
            line = open(pty[2], O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
            /* Only a 'C', which may be among the junk, takes it away. */
            if (line < 0) {
                check(closed(last), "the link is gone");
                break;
            }
        }
    }
    check(finish() == 0, "junk");
    check(!(seed % 2) || access(pty[2], F_OK) != 0, "the link was not removed");
    close(line);
}

int main(void)
{
    const char *temporary = getenv("TMPDIR");
    char folder[4096];

    snprintf(folder, sizeof folder, "%s/serial_test_XXXXXX", temporary ? temporary : "/tmp");
    signal(SIGPIPE, SIG_IGN);
    suspended_s = mmap(NULL, sizeof *suspended_s, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    check(suspended_s != MAP_FAILED, "no memory");
    check(mkdtemp(folder) && chdir(folder) == 0, "no folder");
    command_line();
    ways_to_end();
    silence();
    suspended();
    frozen_together();
    frozen();
    slow_line();
    unplugged();
    busy();
    settings();
    for (int seed = 1; seed <= 300; seed++)
        junk(seed);
    check(chdir("/") == 0 && rmdir(folder) == 0, "something was left behind");
    return 0;
}
