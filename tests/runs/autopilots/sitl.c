/* Stands in for Betaflight's SITL: the same sockets, threads and clock, and a law of a few lines for a quadrotor with a plus of arms.
 * `--config FILE` keeps the file's words, which say how it misbehaves: `ends SECONDS`, `hangs SECONDS`, `crashes SECONDS`, `mute SECONDS`,
 * `unarmed`. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static double state[18];
static struct { double time; uint16_t channels[16]; } sticks;
static struct { uint16_t count; float pulse[16]; } motors;
static int motor_socket;

static int udp(int port, int is_server)
{
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons(port) };
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    fcntl(fd, F_SETFL, O_NONBLOCK);
    if (is_server && bind(fd, (struct sockaddr *)&at, sizeof at))
        exit(9);
    return fd;
}

/* Time of the last packet of the sticks; after 1 s without one it stops its motors, as a failsafe. */
static double sticks_time;

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void take(int fd, void *packet, size_t size)
{
    for (;;) {
        fd_set fds;
        struct timeval limit = { .tv_usec = 100000 };
        FD_ZERO(&fds);
        FD_SET(fd, &fds);
        if (select(fd + 1, &fds, NULL, NULL, &limit) != 1)
            continue;
        recvfrom(fd, packet, size, 0, NULL, NULL);
        if (packet == &sticks)
            sticks_time = seconds();
    }
}

static void *take_states(void *fd)
{
    take(*(int *)fd, state, sizeof state);
    return NULL;
}

static void *take_sticks(void *fd)
{
    take(*(int *)fd, &sticks, sizeof sticks);
    return NULL;
}

static float clamped(double pulse)
{
    return pulse < 1055 ? 1055 : pulse > 2000 ? 2000 : pulse;
}

/* Rear, right, left, front. */
static void fly(void)
{
    double w = state[7], x = state[8], y = -state[9], z = -state[10];
    double roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), pitch = asin(2 * (w * y - z * x));
    double p = state[1], q = -state[2], r = state[3];
    double asked_roll = (sticks.channels[0] - 1500) / 500.0 * 0.5236, asked_pitch = (sticks.channels[1] - 1500) / 500.0 * 0.5236;
    double roll_pulse = 30 * (asked_roll - roll) * 2.6 - 30 * p, pitch_pulse = 30 * (asked_pitch - pitch) * 2.6 - 30 * q;
    double yaw_pulse = 60 * (-(sticks.channels[3] - 1500) / 500.0 * 1.57 - r), throttle = sticks.channels[2];
    motors.pulse[0] = clamped(throttle + pitch_pulse + yaw_pulse);
    motors.pulse[1] = clamped(throttle - roll_pulse - yaw_pulse);
    motors.pulse[2] = clamped(throttle + roll_pulse - yaw_pulse);
    motors.pulse[3] = clamped(throttle - pitch_pulse + yaw_pulse);
}

static void misbehave(const char *words, double now)
{
    double at;
    if (sscanf(words, "ends %lf", &at) == 1 && now > at)
        printf("out of coffee\n"), exit(3);
    if (sscanf(words, "crashes %lf", &at) == 1 && now > at)
        abort();
    if (sscanf(words, "hangs %lf", &at) == 1 && now > at)
        for (printf("thinking\n"), fflush(stdout);;)
            pause();
}

/* Texts of the real program, by which it is known; built with OLD, those of a release without `--config`. */
#ifdef OLD
static const char *volatile known_texts[] = { "Betaflight" };
#define CONFIGURE "--load"
#else
static const char *volatile known_texts[] = { "Betaflight", "--config" };
#define CONFIGURE "--config"
#endif

int main(int count, char **words)
{
    char text[4096] = "", *kept = "eeprom.bin";
    if (count == 3 && known_texts[0] && !strcmp(words[1], CONFIGURE)) {
        FILE *in = fopen(words[2], "r"), *out = fopen(kept, "w");
        while (fgets(text, sizeof text, in)) {
            fputs(text, out);
            printf("# %s", text);
            if (!strncmp(text, "nonsense", 8))
                printf("###ERROR IN input: UNKNOWN COMMAND: nonsense###\n");
        }
        return printf("kept\n"), fclose(out);
    }
    FILE *in = fopen(kept, "r");
    char line[256];
    int is_unarmed = 0;
    double mute = 1e9;
    while (in && fgets(line, sizeof line, in)) {
        is_unarmed |= !strncmp(line, "unarmed", 7);
        if (!strncmp(line, "mute", 4))
            mute = atof(line + 4);
        if (!strncmp(line, "ends", 4) || !strncmp(line, "hangs", 5) || !strncmp(line, "crashes", 7))
            strcpy(text, line);
    }
    int fds[2] = { udp(9003, 1), udp(9004, 1) };
    motor_socket = udp(9001, 0);
    pthread_t threads[2];
    pthread_create(&threads[0], NULL, take_states, &fds[0]);
    pthread_create(&threads[1], NULL, take_sticks, &fds[1]);
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_port = htons(9001) };
    motors.count = 4;
    for (double next = 0;;) {
        /* As the firmware waits: it sleeps, then looks at its clock until the time has come. */
        if (next - seconds() > 3e-4)
            nanosleep(&(struct timespec){ .tv_nsec = 200000 }, NULL);
        while (seconds() < next)
            ;
        next += 1e-3;
        misbehave(text, next);
        if (sticks.channels[4] > 1700 && next - sticks_time < 1 && !is_unarmed)
            fly();
        else
            for (int motor = 0; motor < 4; motor++)
                motors.pulse[motor] = 1000;
        if (next < mute)
            sendto(motor_socket, &motors, sizeof motors, 0, (struct sockaddr *)&to, sizeof to);
    }
}
