#ifndef SERIAL_H
#define SERIAL_H

#define SERIAL_WORDS_MOST 1024     /* of last words */
#define SERIAL_OUT_MOST 8192       /* waiting for the line; the VM keeps to half of it */
#define SERIAL_UNREAD_MOST 65536   /* sent to the VM and not yet said to be taken */
#define SERIAL_TAKEN_STEP 1024     /* bytes for which the VM is told that the line took them */

/* The whole program; apart from main() so that a test can run it in a child of its own. */
int serial_run(int argc, char **argv);

#endif
