/* Preloaded into Betaflight's SITL: its time and its packets come from the simulation alone.
 *
 * The firmware reads a clock that is its own: it begins at 0, and each reading and each sleep of the main thread move it on. At the end
 * of a tick the main thread stops there, answers with its motors, and waits for the next tick's packets. The
 * threads that take packets do so while the main thread waits for them. So a run is a function of its packets, unless somebody
 * connects to a serial port, whose thread keeps the time of the host.
 *
 * Standard input is a socket to the simulator: `struct tick` comes in, `struct answer` goes out, in the machine's byte order.
 * Without HUMMINGBUS_FIRMWARE_BOOT_NS in the environment there is no simulator: the clock runs free, and no packet comes. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { RAW_MOTORS_PORT = 9001, MOTORS_PORT = 9002, STATE_PORT = 9003, STICKS_PORT = 9004, FIRST_SERIAL_PORT = 5761 };
enum { CHANNELS = 16, STATE_VALUES = 18, MOTORS_MAX = 16, SERIAL_PORTS = 16 };

/* Time that a reading of the clock takes, in ns: a loop that waits for a time ends. */
static const uint64_t READING_NS = 2000;

struct state_packet {
    double values[STATE_VALUES];
};

struct sticks_packet {
    double time_s;
    uint16_t channels[CHANNELS];
};

/* A tick's packets. */
struct tick {
    uint64_t length_ns;
    uint64_t has_sticks;
    struct state_packet state;
    struct sticks_packet sticks;
};

/* The firmware's motor outputs, as its raw packet has them. */
struct motors_packet {
    uint16_t count;
    uint16_t padding;
    float pulse_us[MOTORS_MAX];
};

struct answer {
    uint32_t is_fresh;
    struct motors_packet motors;
};

/* A socket whose packets come from the simulation, and the thread that takes them. Its semaphores wake one thread each: a condition
 * variable of all the threads woke each of them for each packet, which doubled the time of a tick. */
struct link {
    int fd;
    /* A packet is there; the thread is done with it. */
    sem_t sent, done;
    /* Of that thread alone: it was told of a packet, and has read it. */
    int is_told, is_taken;
};

static struct link states = { .fd = -1 }, sticks = { .fd = -1 };
static struct tick tick;
static struct answer answer;
static uint64_t now_ns, end_ns = UINT64_MAX;
static int is_lockstep;
static pthread_t main_thread;

static int (*next_clock_gettime)(clockid_t, struct timespec *);
static int (*next_nanosleep)(const struct timespec *, struct timespec *);
static int (*next_select)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
static int (*next_bind)(int, const struct sockaddr *, socklen_t);
static ssize_t (*next_recvfrom)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
static ssize_t (*next_sendto)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);

static void *next(const char *name)
{
    return dlsym(RTLD_NEXT, name);
}

static void begin_link(struct link *link)
{
    sem_init(&link->sent, 0, 0);
    sem_init(&link->done, 0, 0);
}

__attribute__((constructor)) static void begin(void)
{
    begin_link(&states);
    begin_link(&sticks);
    *(void **)&next_clock_gettime = next("clock_gettime");
    *(void **)&next_nanosleep = next("nanosleep");
    *(void **)&next_select = next("select");
    *(void **)&next_bind = next("bind");
    *(void **)&next_recvfrom = next("recvfrom");
    *(void **)&next_sendto = next("sendto");
    main_thread = pthread_self();
    /* The log of a firmware that is killed ends with its last line. */
    setvbuf(stdout, NULL, _IOLBF, 0);
    /* Without its parent nobody is left to fly for. */
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const char *boot_ns = getenv("HUMMINGBUS_FIRMWARE_BOOT_NS");
    if (boot_ns) {
        is_lockstep = 1;
        end_ns = strtoull(boot_ns, NULL, 10);
    }
}

/* Reads or writes `size` bytes of standard input, or ends the process where the simulator has gone. */
static void transfer(int is_out, void *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        char *rest = (char *)bytes + done;
        ssize_t moved = is_out ? send(0, rest, size - done, MSG_NOSIGNAL) : recv(0, rest, size - done, 0);
        if (moved > 0)
            done += (size_t)moved;
        else if (moved == 0 || errno != EINTR)
            _exit(0);
    }
}

/* Waits for `semaphore`, whatever signals come. */
static void await(sem_t *semaphore)
{
    while (sem_wait(semaphore) != 0)
        ;
}

/* Has the thread of `link` take its packet, and waits until it wants the next one. */
static void deliver(struct link *link)
{
    sem_post(&link->sent);
    await(&link->done);
}

/* The main thread at the end of a tick. */
static void finish_tick(void)
{
    transfer(1, &answer, sizeof answer);
    answer.is_fresh = 0;
    transfer(0, &tick, sizeof tick);
    if (tick.has_sticks)
        deliver(&sticks);
    deliver(&states);
    end_ns += tick.length_ns;
}

/* Moves the clock on by `ns`, by the main thread: to the end of the tick, where packets come, and from there on. */
static void advance(uint64_t ns)
{
    while (ns >= end_ns - now_ns) {
        ns -= end_ns - now_ns;
        now_ns = end_ns;
        finish_tick();
    }
    now_ns += ns;
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (clock != CLOCK_MONOTONIC)
        return next_clock_gettime(clock, time);
    if (pthread_equal(pthread_self(), main_thread))
        advance(READING_NS);
    time->tv_sec = (time_t)(now_ns / 1000000000u);
    time->tv_nsec = (long)(now_ns % 1000000000u);
    return 0;
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    if (!pthread_equal(pthread_self(), main_thread))
        return next_nanosleep(time, left);
    advance((uint64_t)time->tv_sec * 1000000000u + (uint64_t)time->tv_nsec);
    return 0;
}

static struct link *link_of(int fd)
{
    return fd < 0 ? NULL : fd == states.fd ? &states : fd == sticks.fd ? &sticks : NULL;
}

/* The packets' sockets are bound to nothing, and serial ports to any that is free, so that firmwares do not meet. */
int bind(int fd, const struct sockaddr *address, socklen_t length)
{
    struct sockaddr_in place;
    if (address->sa_family != AF_INET || length < sizeof place)
        return next_bind(fd, address, length);
    memcpy(&place, address, sizeof place);
    int port = ntohs(place.sin_port);
    if (port == STATE_PORT || port == STICKS_PORT) {
        (port == STATE_PORT ? &states : &sticks)->fd = fd;
        return 0;
    }
    if (port >= FIRST_SERIAL_PORT && port < FIRST_SERIAL_PORT + SERIAL_PORTS) {
        place.sin_port = 0;
        place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    }
    return next_bind(fd, (struct sockaddr *)&place, sizeof place);
}

int select(int count, fd_set *reads, fd_set *writes, fd_set *errors, struct timeval *timeout)
{
    struct link *link = NULL;
    for (int fd = 0; reads && fd < count && !link; fd++)
        link = FD_ISSET(fd, reads) ? link_of(fd) : NULL;
    if (!link)
        return next_select(count, reads, writes, errors, timeout);
    if (!is_lockstep) {
        FD_ZERO(reads);
        return next_select(0, NULL, NULL, NULL, timeout);
    }
    if (link->is_taken) {
        link->is_taken = link->is_told = 0;
        sem_post(&link->done);
    }
    if (!link->is_told)
        await(&link->sent);
    link->is_told = 1;
    return 1;
}

ssize_t recvfrom(int fd, void *bytes, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    struct link *link = is_lockstep ? link_of(fd) : NULL;
    if (!link)
        return next_recvfrom(fd, bytes, size, flags, from, length);
    const void *packet = link == &states ? (const void *)&tick.state : (const void *)&tick.sticks;
    size_t all = link == &states ? sizeof tick.state : sizeof tick.sticks;
    memcpy(bytes, packet, size < all ? size : all);
    link->is_taken = 1;
    return (ssize_t)(size < all ? size : all);
}

ssize_t sendto(int fd, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    int port = to && to->sa_family == AF_INET ? ntohs(((const struct sockaddr_in *)to)->sin_port) : 0;
    if (!is_lockstep || (port != MOTORS_PORT && port != RAW_MOTORS_PORT))
        return next_sendto(fd, bytes, size, flags, to, length);
    if (port == RAW_MOTORS_PORT && size == sizeof answer.motors) {
        memcpy(&answer.motors, bytes, size);
        answer.is_fresh = 1;
    }
    return (ssize_t)size;
}
