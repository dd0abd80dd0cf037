/* Stands in for PX4's SITL with its simulator's MAVLink interface: the same messages, arguments and files, and a law of a few lines, mixed
 * by the rotors' parameters. Parameters of the file say how it misbehaves, at a time of its clock in seconds: `ENDS`, `CRASHES`, `HANGS`,
 * `MUTE`, `WRONG_CRC`, `NOT_A_NUMBER`; or all the time: `NEVER_CONNECTS 1`, `NEVER_BOOTS 1`, `NO_LOCKSTEP 1`, `UNARMED 1`, `LATE 1`,
 * `GARBAGE 1`, `SPLITS 1`, `TWICE 1`, `OLD_CLOCK 1`. */
#include <arpa/inet.h>
#include <math.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { HEARTBEAT = 0, RC = 65, COMMAND = 76, CONTROLS = 93, SENSOR = 107, GPS = 113, STATE = 115 };

static char parameters[200][2][40];
static int count, fd, sensors, gps, sticks, sequence_in = -1, sequence_out;
static uint64_t now, first;
static float force[3], rate[3], attitude[4];
static uint16_t rc[18];

static void fail(const char *what, double found)
{
    printf("%s: %g\n", what, found);
    exit(7);
}

/* The last value of a parameter counts. */
static double parameter(const char *name, double absent)
{
    for (int at = count; at--;)
        if (!strcmp(parameters[at][0], name))
            return atof(parameters[at][1]);
    return absent;
}

static double rotor(int at, const char *name)
{
    char full[32];
    snprintf(full, sizeof full, "CA_ROTOR%d_%s", at, name);
    double value = parameter(full, NAN);
    if (isnan(value))
        fail(full, value);
    return value;
}

static int is_due(const char *name)
{
    return now * 1e-6 >= parameter(name, 1e9);
}

static FILE *opened(const char *folder, const char *name)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *in = fopen(path, "r");
    if (!in)
        printf("no file %s\n", path), exit(7);
    return in;
}

/* The start-up script finds its commands and the parameters in the first folder of the path. */
static void read_parameters(void)
{
    char folder[4096], line[200];
    snprintf(folder, sizeof folder, "%s", getenv("PATH"));
    *strchr(folder, ':') = 0;
    fclose(opened(folder, "px4-alias.sh")), fclose(opened(folder, "px4-param"));
    FILE *in = opened(folder, "px4-rc.params");
    for (; fgets(line, sizeof line, in); count++)
        if (sscanf(line, "param set %39s %39s", parameters[count][0], parameters[count][1]) != 2)
            printf("no parameter: %s", line), exit(7);
    fclose(in);
    if (parameter("CA_ROTOR_COUNT", 0) != 4 || parameter("PWM_MAIN_FUNC4", 0) != 104 || parameter("CA_AIRFRAME", 1))
        fail("other rotors", parameter("CA_ROTOR_COUNT", 0));
}

static int extra(int id)
{
    switch (id) {
    case HEARTBEAT: return 50;
    case RC: return 118;
    case COMMAND: return 152;
    case CONTROLS: return 47;
    case SENSOR: return 108;
    case GPS: return 124;
    case STATE: return 4;
    }
    fail("another message", id);
    return 0;
}

/* The algorithm of the guide to MAVLink. */
static uint16_t checksum(const uint8_t *bytes, int length, int id)
{
    uint16_t sum = 0xFFFF;
    for (int at = 0; at <= length; at++) {
        uint8_t step = (at < length ? bytes[at] : extra(id)) ^ (sum & 0xFF);
        step ^= step << 4;
        sum = (sum >> 8) ^ (step << 8) ^ (step << 3) ^ (step >> 4);
    }
    return sum;
}

static void put(const void *bytes, int length)
{
    if (send(fd, bytes, length, MSG_NOSIGNAL) != length)
        exit(0);
}

static void send_message(int id, const void *payload, int length)
{
    static const uint8_t garbage[] = { 0, 0xFD, 81, 0, 0, 0xFE, 0xFD, 93, 0xFF, 0xFD };
    uint8_t frame[300] = { 0xFD, 0, 0, 0, sequence_out++, 1, 1, id };
    memcpy(frame + 10, payload, length);
    while (length > 1 && !frame[9 + length])
        length--;
    frame[1] = length;
    uint16_t sum = checksum(frame + 1, 9 + length, id);
    if (is_due("WRONG_CRC"))
        sum ^= 1;
    memcpy(frame + 10 + length, &sum, 2);
    if (parameter("GARBAGE", 0))
        put(garbage, 1 + sensors % sizeof garbage);
    int cut = parameter("SPLITS", 0) ? 1 + sensors % (length + 10) : 0;
    if (cut)
        put(frame, cut);
    if (cut && sensors % 50 == 0)
        usleep(1000);
    put(frame + cut, 12 + length - cut);
}

static void heartbeat(void)
{
    uint8_t payload[9] = { 0, 0, 0, 0, 2, 12, 0, 0, 3 };
    send_message(HEARTBEAT, payload, sizeof payload);
}

static float clamped(double output)
{
    return output < 0 ? 0 : output > 1 ? 1 : output;
}

/* Axes forward, right, down. */
static void fly(float *outputs)
{
    double w = attitude[0], x = attitude[1], y = attitude[2], z = attitude[3];
    double roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), pitch = asin(2 * (w * y - z * x));
    double full = parameter("MPC_MAN_TILT_MAX", 0) * M_PI / 180, turn = parameter("MPC_MAN_Y_MAX", 0) * M_PI / 180;
    double hover = parameter("MPC_THR_HOVER", 0), stick = (rc[2] - 1000) / 1000.0, bend = (0.5 - hover) / 0.375;
    double to_roll = 0.078 * ((rc[0] - 1500) / 500.0 * full - roll) - 0.03 * rate[0];
    double to_pitch = 0.078 * (-(rc[1] - 1500) / 500.0 * full - pitch) - 0.03 * rate[1];
    double to_yaw = 0.06 * ((rc[3] - 1500) / 500.0 * turn - rate[2]);
    double thrust = stick * (1 - bend) + stick * stick * stick * bend, base = (sqrt(thrust) - 0.125) / 0.875;
    for (int at = 0; at < 4; at++) {
        double px = rotor(at, "PX"), py = rotor(at, "PY"), arm = hypot(px, py);
        outputs[at] = clamped(base - py / arm * to_roll + px / arm * to_pitch + copysign(1, rotor(at, "KM")) * to_yaw);
    }
}

static void answer(void)
{
    struct { uint64_t time, flags; float outputs[16]; uint8_t mode; } controls = { 0 };
    static double armed = -1;
    int arming = parameter("RC_MAP_ARM_SW", 0);
    int is_on = arming && rc[arming - 1] > 1700 && !parameter("UNARMED", 0);
    armed = !is_on ? -1 : armed < 0 ? now : armed;
    controls.time = now - (parameter("OLD_CLOCK", 0) ? first : 0);
    controls.flags = !parameter("NO_LOCKSTEP", 0);
    controls.mode = is_on ? 129 : 1;
    if (armed >= 0 && now - armed > 1e6)
        fly(controls.outputs);
    if (is_due("NOT_A_NUMBER"))
        controls.outputs[1] = NAN;
    if (parameter("LATE", 0) && sensors % 500 == 0)
        usleep(30000);
    for (int turn = 0; turn < (parameter("TWICE", 0) ? 2 : 1); turn++)
        send_message(CONTROLS, &controls, 81);
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
}

static void within(const char *what, double found, double min, double max)
{
    if (!(found >= min && found <= max))
        fail(what, found);
}

static void sense(const uint8_t *payload)
{
    float floats[13];
    uint32_t fields;
    uint64_t last = now;
    memcpy(&now, payload, 8), memcpy(floats, payload + 8, sizeof floats), memcpy(&fields, payload + 60, 4);
    memcpy(force, floats, sizeof force), memcpy(rate, floats + 3, sizeof rate);
    first = sensors++ ? first : now;
    if (sensors > 1)
        within("step", now - last, 4000, 4000);
    within("fields", fields & 0x3F, 0x3F, 0x3F);
    within("temperature", floats[12], 5, 20), within("number", payload[64], 0, 0);
    within("pressure", floats[9], 945, 965);
    within("field", sqrt(floats[6] * floats[6] + floats[7] * floats[7] + floats[8] * floats[8]), 0.4, 0.6);
    /* It rests, heads east, and the field points north, which is to the left, and down. */
    if (sensors < 100) {
        within("weight", force[2], -9.82, -9.8), within("still", rate[0], 0, 0);
        within("north", floats[7], -0.25, -0.15), within("down", floats[8], 0.4, 0.5);
    }
    within("GPS", gps, sensors / 25, sensors / 25 + 1), within("sticks", sticks, sensors / 5, sensors / 5 + 1);
    misbehave();
    if (sensors % 250 == 0)
        heartbeat();
    /* Its modules start. */
    if (sensors > 30 && !is_due("MUTE") && !parameter("NEVER_BOOTS", 0))
        answer();
    else if (parameter("MUTE", 0))
        heartbeat();
}

static void take_gps(const uint8_t *payload)
{
    int32_t place[3];
    memcpy(place, payload + 8, sizeof place);
    within("latitude", place[0] * 1e-7, 47.39, 47.41), within("longitude", place[1] * 1e-7, 8.54, 8.55);
    within("altitude", place[2] * 1e-3, 487.5, 491), within("fix", payload[34], 3, 3);
    gps++;
}

static void take(const uint8_t *head)
{
    uint8_t payload[255] = { 0 };
    memcpy(payload, head + 10, head[1]);
    if (sequence_in >= 0)
        within("sequence", head[4], (sequence_in + 1) % 256, (sequence_in + 1) % 256);
    sequence_in = head[4];
    switch (head[7]) {
    case SENSOR: sense(payload); break;
    case GPS: take_gps(payload); break;
    case RC: memcpy(rc, payload + 4, sizeof rc), within("channels", payload[40], 18, 18), sticks++; break;
    case STATE: memcpy(attitude, payload + 8, sizeof attitude); break;
    default: fail("another message", head[7]);
    }
}

/* Length of the frame at the beginning; 0 if it is not there yet. */
static int frame_length(const uint8_t *bytes, int length)
{
    if (bytes[0] != 0xFD)
        fail("no start", bytes[0]);
    if (length < 12 || length < 12 + bytes[1])
        return 0;
    uint16_t sum;
    memcpy(&sum, bytes + 10 + bytes[1], 2);
    if (sum != checksum(bytes + 1, 9 + bytes[1], bytes[7]))
        fail("checksum", sum);
    return 12 + bytes[1];
}

static void connect_to(int port)
{
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_port = htons(port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK) };
    int yes = 1;
    for (;; usleep(500)) {
        fd = socket(AF_INET, SOCK_STREAM, 0);
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
        if (!connect(fd, (struct sockaddr *)&to, sizeof to))
            return;
        close(fd);
    }
}

int main(int words_count, char **words)
{
    static uint8_t bytes[65536];
    int instance = -1, option, length = 0;
    setvbuf(stdout, NULL, _IOLBF, 0);
    while ((option = getopt(words_count, words, "di:w:")) != -1)
        if (option == 'i')
            instance = atoi(optarg);
        else if (option == 'w' && chdir(optarg))
            fail("no folder", 0);
    if (instance < 0 || optind >= words_count || strcmp(getenv("PX4_SIM_MODEL"), "none_iris"))
        fail("other arguments", instance);
    fclose(opened(words[optind], "init.d-posix/rcS"));
    read_parameters();
    printf("Stands in for PX4\n");
    if (parameter("NEVER_CONNECTS", 0))
        pause();
    connect_to(4560 + instance);
    uint8_t interval[33] = { 0 };
    heartbeat();
    send_message(COMMAND, interval, sizeof interval);
    for (ssize_t more; (more = recv(fd, bytes + length, sizeof bytes - length, 0)) > 0;) {
        int at = 0, taken;
        for (length += more; at < length && (taken = frame_length(bytes + at, length - at)); at += taken)
            take(bytes + at);
        memmove(bytes, bytes + at, length -= at);
    }
}
