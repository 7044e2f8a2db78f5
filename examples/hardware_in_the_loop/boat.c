/* The other end of hardware.py: an exported law at a UDP port. All numbers are little-endian
   doubles, as on every platform that podusv exports for. */
#define _POSIX_C_SOURCE 200112L
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>

#include "law.h"

int main(int count, char **words)
{
    double given[16], answer[3]; /* time, state, target, loads; time, demand */
    struct sockaddr_in address = {0};
    struct sockaddr *peer = (struct sockaddr *)&address;
    socklen_t size = sizeof address;
    int link = socket(AF_INET, SOCK_DGRAM, 0);
    podusv_law law;

    address.sin_family = AF_INET;
    address.sin_port = htons(count > 1 ? atoi(words[1]) : 0); /* 0: the system chooses */
    if (bind(link, peer, size) || getsockname(link, peer, &size)) {
        perror("boat");
        return 1;
    }
    printf("%d\n", ntohs(address.sin_port));
    fflush(stdout);
    podusv_law_start(&law);
    for (;;) {
        if (recvfrom(link, given, sizeof given, 0, peer, &size) != sizeof given)
            continue;
        if (given[0] == 0.0) /* another run begins */
            podusv_law_start(&law);
        podusv_law_step(&law, given + 1, given + 7, given + 13, answer + 1);
        answer[0] = given[0];
        sendto(link, answer, sizeof answer, 0, peer, size);
    }
}
