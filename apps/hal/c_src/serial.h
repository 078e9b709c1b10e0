#ifndef SERIAL_H
#define SERIAL_H

#define SERIAL_WORDS_MOST 1024     /* of last words */
#define SERIAL_OUT_MOST 8192       /* waiting for the line; the VM uses at most half */
#define SERIAL_UNREAD_MOST 65536   /* sent to the VM, which has not reported them taken */
#define SERIAL_TAKEN_STEP 1024     /* bytes taken by the line that are worth a report */

/* The whole program; separate from main(), so that a test can run it in a child process. */
int serial_run(int argc, char **argv);

#endif
