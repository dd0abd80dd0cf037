/* Stands in for PX4's SITL with its simulator's MAVLink interface: the same messages, arguments, files, start-up script and commands, and a
 * law of a few lines, mixed by the rotors' parameters. Parameters say how it misbehaves, at a time of its clock in seconds: `ENDS`,
 * `CRASHES`, `HANGS`, `MUTE`, `WRONG_CRC`, `NOT_A_NUMBER`; or all the time: `NEVER_CONNECTS 1`, `NEVER_BOOTS 1`, `NO_LOCKSTEP 1`,
 * `UNARMED 1`, `TWICE 1`, `LATE 1`. With `LOST 1` the remote control may be lost and the vehicle fall. */
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

enum { HEARTBEAT = 0, RC = 65, COMMAND = 76, CONTROLS = 93, SENSOR = 107, GPS = 113, STATE = 115 };

static char parameters[200][2][40];
static int count, instance, fd, sensors, gps, sticks, sequence_in = -1, sequence_out;
static uint64_t now;
static float force[3], rate[3], attitude[4];
static uint16_t rc[18];
/* Time of the last remote control; after 1 s without it stops its motors, as a failsafe. */
static uint64_t rc_time;
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t stepped = PTHREAD_COND_INITIALIZER;

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
    uint8_t frame[300] = { 0xFD, 0, 0, 0, sequence_out++, 1, 1, id };
    memcpy(frame + 10, payload, length);
    while (length > 1 && !frame[9 + length])
        length--;
    frame[1] = length;
    uint16_t sum = checksum(frame + 1, 9 + length, id);
    if (is_due("WRONG_CRC"))
        sum ^= 1;
    memcpy(frame + 10 + length, &sum, 2);
    put(frame, 12 + length);
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
    double thrust = (rc[2] - 1000) / 1000.0, square = parameter("THR_MDL_FAC", 0), line = 1 - square;
    double to_roll = 0.078 * ((rc[0] - 1500) / 500.0 * full - roll) - 0.03 * rate[0];
    double to_pitch = 0.078 * (-(rc[1] - 1500) / 500.0 * full - pitch) - 0.03 * rate[1];
    double to_yaw = 0.06 * ((rc[3] - 1500) / 500.0 * turn - rate[2]);
    double base = (sqrt(line * line + 4 * square * thrust) - line) / (2 * square);
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
    controls.time = now;
    controls.flags = !parameter("NO_LOCKSTEP", 0);
    controls.mode = is_on ? 129 : 1;
    if (armed >= 0 && now - armed > 1e6 && now - rc_time < 1000000)
        fly(controls.outputs);
    if (is_due("NOT_A_NUMBER"))
        controls.outputs[1] = NAN;
    if (parameter("TWICE", 0)) {
        float outputs[16];
        memcpy(outputs, controls.outputs, sizeof outputs);
        memset(controls.outputs, 0, sizeof outputs);
        send_message(CONTROLS, &controls, 81);
        memcpy(controls.outputs, outputs, sizeof outputs);
    }
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
    /* By the host's time: a call of the C library would wait in the simulation's. */
    if (parameter("LATE", 0) && sensors % 100 == 0)
        syscall(SYS_nanosleep, &(struct timespec) { .tv_nsec = 30000000 }, NULL);
}

static void within(const char *what, double found, double min, double max)
{
    if (!(found >= min && found <= max))
        fail(what, found);
}

/* A sensor whose numbers stay the same is broken: PX4 counts the equal ones, in the steps of its simulated sensors. */
static void refuse_constants(const float *floats, uint32_t fields)
{
    static const double steps[] = { 9.80665 / 2048, 2000.0 / 32768 * M_PI / 180, 1e-6, 1e-8 };
    static double before[10];
    static int equal[10];
    for (int at = 0; at < 10; at++)
        if (fields & 1u << at) {
            double value = trunc(floats[at] / steps[at / 3]);
            equal[at] = value == before[at] ? equal[at] + 1 : 0;
            before[at] = value;
            within("equal values of a sensor", equal[at], 0, 33);
        }
}

static void sense(const uint8_t *payload)
{
    float floats[13];
    uint32_t fields;
    uint64_t last = now;
    memcpy(&now, payload, 8), memcpy(floats, payload + 8, sizeof floats), memcpy(&fields, payload + 60, 4);
    memcpy(force, floats, sizeof force), memcpy(rate, floats + 3, sizeof rate);
    if (sensors++)
        within("step", now - last, 4000, 4000);
    refuse_constants(floats, fields);
    within("fields", fields & 0x3F, 0x3F, 0x3F);
    within("temperature", floats[12], 5, 20), within("number", payload[64], 0, 0);
    within("pressure", floats[9], 945, 965);
    within("field", sqrt(floats[6] * floats[6] + floats[7] * floats[7] + floats[8] * floats[8]), 0.4, 0.6);
    /* It rests, heads east, and the field points north, which is to the left, and down. */
    if (sensors < 100) {
        within("weight", force[2], -9.82, -9.8), within("still", rate[0], -0.002, 0.002);
        within("north", floats[7], -0.25, -0.15), within("down", floats[8], 0.4, 0.5);
    }
    within("GPS", gps, sensors / 25, sensors / 25 + 1), within("sticks", sticks, parameter("LOST", 0) ? 0 : sensors / 5, sensors / 5 + 1);
    misbehave();
    if (sensors % 250 == 0)
        heartbeat();
    /* Its modules start. */
    if (sensors > 30 && !is_due("MUTE"))
        answer();
    else if (parameter("MUTE", 0))
        heartbeat();
    pthread_mutex_lock(&mutex);
    pthread_cond_broadcast(&stepped);
    pthread_mutex_unlock(&mutex);
}

static void take_gps(const uint8_t *payload)
{
    int32_t place[3];
    memcpy(place, payload + 8, sizeof place);
    within("latitude", place[0] * 1e-7, 47.39, 47.41), within("longitude", place[1] * 1e-7, 8.54, 8.55);
    within("altitude", place[2] * 1e-3, parameter("LOST", 0) ? 400 : 487.5, 491), within("fix", payload[34], 3, 3);
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
    case RC: memcpy(rc, payload + 4, sizeof rc), within("channels", payload[40], 18, 18), sticks++, rc_time = now; break;
    case STATE: memcpy(attitude, payload + 8, sizeof attitude); break;
    default: fail("another message", head[7]);
    }
}

static void *simulate(void *unused)
{
    static uint8_t bytes[2048];
    struct sockaddr_in to = { .sin_family = AF_INET, .sin_port = htons(4560 + instance), .sin_addr.s_addr = htonl(INADDR_ANY) };
    struct pollfd file = { fd = socket(AF_INET, SOCK_STREAM, 0), POLLIN, 0 };
    while (connect(fd, (struct sockaddr *)&to, sizeof to))
        usleep(500);
    for (heartbeat(); poll(&file, 1, 1000) >= 0;) {
        int length = recvfrom(fd, bytes, sizeof bytes, 0, NULL, NULL);
        for (int at = 0; at < length; at += 12 + bytes[at + 1]) {
            uint16_t sum;
            memcpy(&sum, bytes + at + 10 + bytes[at + 1], 2);
            if (bytes[at] != 0xFD || sum != checksum(bytes + at + 1, 9 + bytes[at + 1], bytes[at + 7]))
                fail("no frame", bytes[at]);
            take(bytes + at);
        }
    }
    return unused;
}

/* Waits for a number of steps, as the modules of PX4 do that start. */
static void await_steps(int wanted)
{
    pthread_mutex_lock(&mutex);
    for (int until = sensors + wanted; sensors < until;)
        pthread_cond_wait(&stepped, &mutex);
    pthread_mutex_unlock(&mutex);
}

static void carry_out(const char *line, FILE *out)
{
    pthread_t thread;
    char name[40], value[40];
    if (sscanf(line, "param set %39s %39s", name, value) == 2) {
        if (!strcmp(name, "UNKNOWN"))
            fprintf(out, "ERROR [param] Parameter %s not found.\n", name);
        strcpy(parameters[count][0], name), strcpy(parameters[count++][1], value);
    } else if (!strcmp(line, "simulator start")) {
        if (parameter("CA_ROTOR_COUNT", 0) != 4 || parameter("PWM_MAIN_FUNC4", 0) != 104 || parameter("CA_AIRFRAME", 1))
            fail("other rotors", parameter("CA_ROTOR_COUNT", 0));
        if (!parameter("NEVER_CONNECTS", 0))
            pthread_create(&thread, NULL, simulate, NULL);
        await_steps(1);
    } else if (!strcmp(line, "ekf2 start")) {
        await_steps(parameter("NEVER_BOOTS", 0) ? 1000000 : 7);
    } else if (!strcmp(line, "logger start")) {
        /* The command before has ended. */
        within("steps of the start", sensors, 8, 8);
    } else {
        printf("no command: %s\n", line), exit(7);
    }
}

static void *serve_client(void *client)
{
    char line[1024] = "";
    FILE *out = client;
    int file = fileno(out);
    if (read(file, line, sizeof line - 1) > 0)
        carry_out(line, out);
    fflush(out);
    shutdown(file, SHUT_RDWR);
    return NULL;
}

static struct sockaddr_un command_socket(void)
{
    struct sockaddr_un at = { .sun_family = AF_UNIX };
    snprintf(at.sun_path, sizeof at.sun_path, "/tmp/px4-sock-%d", instance);
    return at;
}

static void *serve(void *unused)
{
    struct sockaddr_un at = command_socket();
    struct pollfd files[50] = { { socket(AF_UNIX, SOCK_STREAM, 0), POLLIN, 0 } };
    FILE *outs[50];
    int open_files = 1;
    unlink(at.sun_path);
    if (bind(files[0].fd, (struct sockaddr *)&at, sizeof at) || listen(files[0].fd, 10))
        fail("socket", errno);
    while (poll(files, open_files, -1) > 0) {
        if (files[0].revents) {
            pthread_t thread;
            int client = accept(files[0].fd, NULL, NULL);
            files[open_files] = (struct pollfd) { client, POLLHUP, 0 };
            outs[open_files] = fdopen(client, "w");
            pthread_create(&thread, NULL, serve_client, outs[open_files++]);
            pthread_detach(thread);
        }
        for (int file = 1; file < open_files; file++)
            if (files[file].revents) {
                fclose(outs[file]);
                files[file] = files[--open_files];
                outs[file] = outs[open_files];
            }
    }
    return unused;
}

/* A command of the start-up script. */
static int command(int words_count, char **words)
{
    char bytes[1024];
    struct sockaddr_un to;
    instance = atoi(words[2]);
    to = command_socket();
    int file = socket(AF_UNIX, SOCK_STREAM, 0), length = snprintf(bytes, sizeof bytes, "%s", strrchr(words[0], '-') + 1);
    for (int word = 3; word < words_count; word++)
        length += snprintf(bytes + length, sizeof bytes - length, " %s", words[word]);
    if (connect(file, (struct sockaddr *)&to, sizeof to) || write(file, bytes, length + 1) < 0)
        return 1;
    while ((length = read(file, bytes, sizeof bytes)) > 0)
        fwrite(bytes, length, 1, stdout);
    return 0;
}

int main(int words_count, char **words)
{
    int option;
    char line[200];
    struct stat lock;
    pthread_t thread;
    const char *name = strrchr(words[0], '/') ? strrchr(words[0], '/') + 1 : words[0];
    if (!strncmp(name, "px4-", 4))
        return command(words_count, words);
    while ((option = getopt(words_count, words, "di:w:")) != -1)
        if (option == 'i')
            instance = atoi(optarg);
        else if (option == 'w' && chdir(optarg))
            return 8;
    /* Another user's file in /tmp would not open. */
    snprintf(line, sizeof line, "/tmp/px4_lock-%d", instance);
    if (open(line, O_RDWR | O_CREAT, 0666) < 0 || stat("../px4_lock-0", &lock))
        fail("lock", instance);
    if (optind + 1 != words_count || symlink(words[optind], "etc") || strcmp(getenv("PX4_SIM_MODEL"), "none_iris"))
        fail("arguments", words_count);
    pthread_create(&thread, NULL, serve, NULL);
    usleep(1000);
    snprintf(line, sizeof line, "/bin/sh etc/init.d-posix/rcS %d", instance);
    if (system(line))
        fail("start-up script", 0);
    printf("Startup script returned successfully\n");
    for (;;)
        usleep(100000);
}
