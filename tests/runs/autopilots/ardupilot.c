/* Stands in for ArduCopter's SITL with its JSON interface: the same packets and arguments, and a law of a few lines for a quadrotor with
 * a plus of arms. Parameters of the file say how it misbehaves, at a time of its clock in seconds: `ENDS`, `CRASHES`, `HANGS`,
 * `WRONG_MAGIC`, `SHORT`, `GOES_BACK`; or all the time: `MUTE 1`, `UNARMED 1`, `RESENDS 1`, `LATE 1`, `FOREIGN 1`. */
#include <arpa/inet.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static struct { uint16_t magic, rate; uint32_t frame; uint16_t pulse[16]; } packet = { .magic = 18458, .rate = 1000 };
static double now, gyro[3], force[3], position[3], velocity[3], attitude[4];
/* As the firmware has them until the first packet comes. */
static double rc[16] = { 1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800 };
/* Time of the last packet; after 1 s without one it stops its motors, as a failsafe. */
static double rc_time;
static int rc_port;
static char parameters[100][2][40];
static int count;

static void fail(const char *what, const char *found)
{
    printf("%s: %s\n", what, found ? found : "missing");
    exit(7);
}

static const char *argument(int count, char **words, const char *name)
{
    for (int at = 1; at + 1 < count; at += 2)
        if (!strcmp(words[at], name))
            return words[at + 1];
    fail(name, NULL);
    return NULL;
}

/* A parameter that stands twice has no value. */
static double parameter(const char *name, double absent)
{
    double value = absent;
    for (int at = 0, found = 0; at < count; at++)
        if (!strcmp(parameters[at][0], name) && (value = atof(parameters[at][1]), found++))
            fail("twice", name);
    return value;
}

static void require(const char *name, double value)
{
    if (parameter(name, -1) != value)
        fail("another value", name);
}

static int is_due(const char *name)
{
    return now >= parameter(name, 1e9);
}

static void read_parameters(const char *path)
{
    FILE *in = fopen(path, "r");
    char line[100];
    if (!in)
        fail("no file", path);
    for (; fgets(line, sizeof line, in); count++)
        if (sscanf(line, "%39s %39s", parameters[count][0], parameters[count][1]) != 2)
            fail("no parameter", line);
    fclose(in);
    require("FRAME_CLASS", 1), require("FRAME_TYPE", 0), require("MOT_PWM_MIN", 1000), require("MOT_PWM_MAX", 2000);
    require("SERVO1_FUNCTION", 33), require("SERVO4_FUNCTION", 36), require("AHRS_EKF_TYPE", 3), require("LOG_BACKEND_TYPE", 0);
}

/* Two firmwares with the same port fail. */
static int bound(int port)
{
    struct sockaddr_in at = { .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (bind(fd, (struct sockaddr *)&at, sizeof at))
        fail("port in use", "--sim-port-in, --rc-in-port or --irlock-port");
    return fd;
}

/* Numbers behind the first `key` of the text. */
static void numbers(const char *text, const char *key, double *to, int count)
{
    const char *at = strstr(text, key);
    char *end;
    if (!at || strncmp(at + strlen(key), "\":", 2))
        fail("no key", key);
    at += strlen(key) + 2;
    for (int part = 0; part < count; part++, at = end) {
        to[part] = strtod(at + (count > 1), &end);
        if (end == at + (count > 1))
            fail("no number", key);
    }
}

static void take(char *text, ssize_t length)
{
    double last = now, unpaced;
    if (length < 3 || text[0] != '\n' || text[length - 1] != '\n' || memchr(text + 1, '\n', length - 2))
        fail("no line", text);
    numbers(text, "timestamp", &now, 1), numbers(text, "gyro", gyro, 3), numbers(text, "accel_body", force, 3);
    numbers(text, "position", position, 3), numbers(text, "velocity", velocity, 3), numbers(text, "quaternion", attitude, 4);
    numbers(text, "no_time_sync", &unpaced, 1);
    if (unpaced != 1 || !(now > last) || !(now - last < 0.1))
        fail("another clock", text);
}

/* As the firmware does: every 10 ms it takes the newest packet that is there, and it opens the port when it first looks. */
static void take_rc(void)
{
    static double next = 0.01;
    static int fd = -1;
    uint16_t taken[16];
    if (now < next)
        return;
    next = now + 0.01;
    if (fd < 0)
        fd = bound(rc_port);
    for (ssize_t length; (length = recv(fd, taken, sizeof taken, MSG_DONTWAIT | MSG_TRUNC)) >= 0;) {
        if (length != sizeof taken)
            fail("another length", "remote control");
        rc_time = now;
        for (int channel = 0; channel < 16; channel++)
            if (taken[channel])
                rc[channel] = taken[channel];
    }
}

static uint16_t clamped(double pulse)
{
    return pulse < 1055 ? 1055 : pulse > 2000 ? 2000 : (uint16_t)lround(pulse);
}

/* Axes forward, right, down; motors right, left, front, rear, of which the first two turn counter-clockwise. */
static void fly(void)
{
    double w = attitude[0], x = attitude[1], y = attitude[2], z = attitude[3];
    double roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), pitch = asin(2 * (w * y - z * x));
    double full = parameter("ATC_ANGLE_MAX", 0) * M_PI / 180, turn = parameter("PILOT_Y_RATE", 0) * M_PI / 180;
    double forward = parameter("RC2_REVERSED", 0) == 1 ? -1 : 1, hover = parameter("MOT_THST_HOVER", 0);
    double asked_roll = (rc[0] - 1500) / 500 * full, asked_pitch = forward * (rc[1] - 1500) / 500 * full;
    double roll_pulse = 78 * (asked_roll - roll) - 30 * gyro[0], pitch_pulse = 78 * (asked_pitch - pitch) - 30 * gyro[1];
    double yaw_pulse = 60 * ((rc[3] - 1500) / 500 * turn - gyro[2]), stick = (rc[2] - 1000) / 1000, bend = (0.5 - hover) / 0.375;
    double thrust = stick * (1 - bend) + stick * stick * stick * bend, base = 1000 + 1000 * (sqrt(thrust) - 0.125) / 0.875;
    packet.pulse[0] = clamped(base - roll_pulse + yaw_pulse);
    packet.pulse[1] = clamped(base + roll_pulse + yaw_pulse);
    packet.pulse[2] = clamped(base + pitch_pulse - yaw_pulse);
    packet.pulse[3] = clamped(base - pitch_pulse - yaw_pulse);
}

static void misbehave(void)
{
    if (is_due("ENDS"))
        printf("out of coffee\n"), exit(3);
    if (is_due("CRASHES"))
        abort();
    if (is_due("HANGS"))
        for (printf("thinking\n"), fflush(stdout);;)
            pause();
    if (is_due("WRONG_MAGIC"))
        packet.magic = 4711;
    if (is_due("GOES_BACK"))
        packet.frame = 1;
    if (parameter("LATE", 0) && packet.frame % 500 == 0)
        usleep(30000);
}

int main(int words_count, char **words)
{
    const char *others[] = { "--sim-port-in", "--irlock-port" };
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (strcmp(argument(words_count, words, "--model"), "JSON:127.0.0.1") || strcmp(argument(words_count, words, "--speedup"), "1"))
        fail("another model", NULL);
    double place[4];
    if (sscanf(argument(words_count, words, "--home"), "%lf,%lf,%lf,%lf", &place[0], &place[1], &place[2], &place[3]) != 4)
        fail("no place", "--home");
    /* The first serial port would wait for a connection. */
    if (strcmp(argument(words_count, words, "--serial0"), "none:0"))
        fail("an open port", "--serial0");
    /* Without it, the firmware's GPS tells the host's time. */
    argument(words_count, words, "--start-time");
    for (int at = 0; at < 2; at++)
        bound(atoi(argument(words_count, words, others[at])));
    rc_port = atoi(argument(words_count, words, "--rc-in-port"));
    to.sin_port = htons(atoi(argument(words_count, words, "--sim-port-out")));
    read_parameters(argument(words_count, words, "--defaults"));
    printf("Stands in for ArduCopter\n");
    /* As the firmware does: it sends, and takes the answers, where the system has given it a port. */
    int fd = socket(AF_INET, SOCK_DGRAM, 0), other = socket(AF_INET, SOCK_DGRAM, 0);
    if (parameter("MUTE", 0))
        pause();
    int arming = 0;
    for (int channel = 5; channel <= 16; channel++) {
        char name[16];
        snprintf(name, sizeof name, "RC%d_OPTION", channel);
        arming = parameter(name, 0) == 153 ? channel : arming;
    }
    for (double armed = -1;; packet.frame++) {
        misbehave();
        int is_on = arming && rc[arming - 1] > 1700 && !parameter("UNARMED", 0);
        armed = !is_on ? -1 : armed < 0 ? now : armed;
        /* Motors stand still for 2 s after arming. */
        if (armed >= 0 && now - armed > 2 && now - rc_time < 1)
            fly();
        else
            for (int motor = 0; motor < 4; motor++)
                packet.pulse[motor] = 1000;
        size_t length = is_due("SHORT") ? 39 : sizeof packet;
        for (int turn = 0; turn < (parameter("RESENDS", 0) ? 2 : 1); turn++)
            sendto(fd, &packet, length, 0, (struct sockaddr *)&to, sizeof to);
        if (parameter("FOREIGN", 0)) {
            uint32_t frame = packet.frame;
            packet.frame += 1000000;
            sendto(other, &packet, sizeof packet, 0, (struct sockaddr *)&to, sizeof to);
            packet.frame = frame;
        }
        char text[4096] = "";
        take(text, recv(fd, text, sizeof text - 1, 0));
        take_rc();
    }
}
