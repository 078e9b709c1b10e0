#include "serial.h"

int main(int argc, char **argv)
{
    return serial_run(argc, argv);
}
