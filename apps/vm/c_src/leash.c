/*
 * leash PROGRAM [ARGUMENT...]: runs a program that ends when whoever started it ends, even when it is
 * frozen by SIGSTOP then. Where the kernel has no such thing (it is Linux's), the program is just run;
 * it then ends as it does anyway, when its standard input closes.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#ifdef __linux__
#include <sys/prctl.h>
#endif

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "usage: leash PROGRAM [ARGUMENT...]\n");
        return 2;
    }

#ifdef __linux__
    pid_t parent = getppid();

    /* It may have ended just before we asked to be told. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || getppid() != parent) {
        fprintf(stderr, "leash: whoever started this is gone\n");
        return 1;
    }
#endif

    execvp(argv[1], argv + 1);
    fprintf(stderr, "leash: %s cannot be run: %s\n", argv[1], strerror(errno));
    return 127;
}
