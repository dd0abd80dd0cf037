/* Preloaded into PX4's SITL and into the processes of its start-up script: the simulation alone decides about its time and the order of its
 * threads.
 *
 * One thread of PX4 runs at a time. It runs until it waits: for a mutex, a condition, a time, a file, another thread. Then the thread that is
 * ready for the longest time goes on. If all threads wait, the step is over: this library answers the simulator, reads the messages of the
 * next step, and gives them to the thread that takes the simulator's messages. So a run is a function of its messages.
 *
 * The start-up script runs by the time of the host, one command after the other. Simulated time stands still between two commands.
 *
 * Standard input is a socket to the simulator. In both directions: `struct head`, then its bytes. PX4's lock file and the socket of its
 * commands lie in the folder above that in which it runs, and not in /tmp. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/futex.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#ifndef SYS_pidfd_open
#define SYS_pidfd_open 434
#endif

enum { THREADS_MAX = 512, FILES_MAX = 1024, BYTES_MAX = 65536, FIRST_PORT = 4560, PORTS = 256 };

/* The clock of the host as PX4 sees it begins on 2025-01-01. */
static const uint64_t EPOCH_S = 1735689600;
static const uint64_t NEVER = UINT64_MAX;

/* Head of what is sent over the socket. */
struct head {
    /* Bytes that follow. */
    uint32_t length;
    /* From the simulator: length of the step, us. To the simulator: 1 if the start-up script has ended. */
    uint32_t value;
};

enum state { FREE, RUNS, IS_READY, WAITS_MUTEX, WAITS_CONDITION, WAITS_END, WAITS_TIME, WAITS_FILES, WAITS_STEP };

struct thread {
    enum state state;
    /* The mutex, condition or thread that it waits for. */
    const void *object;
    /* Order in which threads began to wait, or became ready. */
    uint64_t since;
    /* Time at which it goes on in any case, us. */
    uint64_t until_us;
    struct pollfd *files;
    nfds_t file_count;
    pthread_t id;
    void *(*start)(void *);
    void *argument;
    uint32_t go;
};

static struct thread threads[THREADS_MAX];
static int thread_count;
static __thread struct thread *self;
static pthread_key_t end_key;
static uint64_t turn, now_us;
static int link_fd = -1, simulator_fd = -1, mutex_waiters;
/* The start-up script runs; it has ended; number of its commands that PX4 runs at present; connections that they came over. */
static int is_starting, is_started, commands;
static char is_client[FILES_MAX], is_command[FILES_MAX];
static uint8_t input[BYTES_MAX], output[BYTES_MAX];
static size_t input_length, input_read, output_length;

/* The functions of the same names in the C library. */
#define NEXT(name) ((__typeof__(&name))next(#name, (void **)&next_##name))

static void *next(const char *name, void **place)
{
    if (!*place)
        *place = dlsym(RTLD_NEXT, name);
    return *place;
}

static void *next_pthread_create, *next_pthread_join, *next_pthread_kill, *next_pthread_setschedparam, *next_pthread_mutex_lock,
    *next_pthread_mutex_unlock, *next_pthread_cond_wait, *next_pthread_cond_timedwait, *next_pthread_cond_clockwait, *next_pthread_cond_signal,
    *next_pthread_cond_broadcast, *next_usleep, *next_sleep, *next_nanosleep, *next_clock_nanosleep, *next_clock_gettime, *next_clock_settime,
    *next_gettimeofday, *next_poll, *next_read, *next_recv, *next_recvfrom, *next_send, *next_sendto, *next_connect, *next_bind, *next_unlink,
    *next_open, *next_open64, *next_accept, *next_shutdown, *next_system;

/* Conditions have an older version, which a search without a version may find. */
#define NEXT_CONDITION(name) ((__typeof__(&name))next_version(#name, (void **)&next_##name))

static void *next_version(const char *name, void **place)
{
#ifdef __GLIBC__
    if (!*place)
        *place = dlvsym(RTLD_NEXT, name, "GLIBC_2.3.2");
#endif
    return next(name, place);
}

static void transfer(int is_out, void *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        char *rest = (char *)bytes + done;
        ssize_t moved =
            is_out ? NEXT(send)(link_fd, rest, size - done, MSG_NOSIGNAL) : NEXT(recv)(link_fd, rest, size - done, 0);
        if (moved > 0)
            done += (size_t)moved;
        else if (moved == 0 || errno != EINTR)
            _exit(0);
    }
}

static void make_ready(struct thread *thread)
{
    if (thread->state == WAITS_MUTEX)
        mutex_waiters--;
    thread->state = IS_READY;
    thread->since = turn++;
}

/* Moves the clock of sleepers to `time_us`. A deadline may lie in the past: the clock never goes back. */
static void move_clock(uint64_t time_us)
{
    if (time_us > now_us)
        now_us = time_us;
    for (;;) {
        struct thread *first = NULL;
        for (struct thread *at = threads; at < threads + thread_count; at++)
            if (at->state >= WAITS_MUTEX && at->until_us <= now_us &&
                (!first || at->until_us < first->until_us || (at->until_us == first->until_us && at->since < first->since)))
                first = at;
        if (!first)
            return;
        make_ready(first);
    }
}

static void give_up(const char *reason)
{
    dprintf(2, "hummingbus: %s\n", reason);
    _exit(1);
}

/* Answers, and reads the messages of the next step. */
static void exchange(struct thread *taker)
{
    struct head head = { (uint32_t)output_length, (uint32_t)is_started };
    transfer(1, &head, sizeof head);
    transfer(1, output, output_length);
    output_length = 0;
    transfer(0, &head, sizeof head);
    if (head.length > sizeof input)
        give_up("a step of the simulator is longer than 65536 bytes");
    transfer(0, input, head.length);
    input_length = head.length;
    input_read = 0;
    make_ready(taker);
    move_clock(now_us + head.value);
}

/* Waits up to `timeout_ms` for a file, and makes the thread ready that waits for it; false if there is none. One thread runs at a time, so
 * that all can use the same arrays: the stacks of PX4's threads are small. */
static int look_at_files(int timeout_ms)
{
    static struct pollfd files[FILES_MAX];
    static struct thread *owners[FILES_MAX];
    nfds_t count = 0;
    for (struct thread *at = threads; at < threads + thread_count; at++)
        for (nfds_t file = 0; at->state == WAITS_FILES && file < at->file_count && count < FILES_MAX; file++) {
            owners[count] = at;
            files[count++] = at->files[file];
        }
    if (NEXT(poll)(files, count, timeout_ms) <= 0)
        return 0;
    struct thread *first = NULL;
    for (nfds_t file = 0; file < count; file++)
        if (files[file].revents && (!first || owners[file]->since < first->since))
            first = owners[file];
    if (first)
        make_ready(first);
    return first != NULL;
}

/* All threads wait: makes one or more ready. */
static void await_something(void)
{
    for (;;) {
        if (look_at_files(0))
            return;
        /* Between two commands of the start-up script nothing moves. */
        int is_open = !is_starting || commands > 0;
        struct thread *taker = NULL, *first = NULL;
        for (struct thread *at = threads; at < threads + thread_count; at++) {
            if (at->state == WAITS_STEP)
                taker = at;
            if (at->state >= WAITS_MUTEX && at->until_us != NEVER && (!first || at->until_us < first->until_us))
                first = at;
        }
        if (is_open && taker)
            exchange(taker);
        else if (is_open && first)
            move_clock(first->until_us);
        else if (!look_at_files(-1))
            continue;
        return;
    }
}

static void futex(uint32_t *word, int operation, uint32_t value)
{
    syscall(SYS_futex, word, operation | FUTEX_PRIVATE_FLAG, value, NULL, NULL, 0);
}

static struct thread *next_ready(void)
{
    struct thread *first = NULL;
    for (struct thread *at = threads; at < threads + thread_count; at++)
        if (at->state == IS_READY && (!first || at->since < first->since))
            first = at;
    return first;
}

static void await_go(void)
{
    while (!__atomic_load_n(&self->go, __ATOMIC_ACQUIRE))
        futex(&self->go, FUTEX_WAIT, 0);
    self->go = 0;
}

/* Lets the next thread run, which may be this one; true if it is. The caller has set its own state. */
static int pass_on(void)
{
    struct thread *to = next_ready();
    while (!to) {
        await_something();
        to = next_ready();
    }
    to->state = RUNS;
    if (to == self)
        return 1;
    __atomic_store_n(&to->go, 1, __ATOMIC_RELEASE);
    futex(&to->go, FUTEX_WAKE, 1);
    return 0;
}

/* Waits for `object`, until `until_us` at the latest. */
static void wait_for(enum state state, const void *object, uint64_t until_us)
{
    self->state = state;
    self->object = object;
    self->since = turn++;
    self->until_us = until_us;
    if (state == WAITS_MUTEX)
        mutex_waiters++;
    if (!pass_on())
        await_go();
}

/* The thread that waits for `object` for the longest time. */
static struct thread *first_waiter(enum state state, const void *object)
{
    struct thread *first = NULL;
    for (struct thread *at = threads; at < threads + thread_count; at++)
        if (at->state == state && at->object == object && (!first || at->since < first->since))
            first = at;
    return first;
}

/* Threads. */

/* The end of a thread, behind its destructors of C++. */
static void end_thread(void *thread)
{
    struct thread *waiter;
    while ((waiter = first_waiter(WAITS_END, thread)))
        make_ready(waiter);
    self->state = FREE;
    pass_on();
    self = NULL;
}

static void *run_thread(void *thread)
{
    self = thread;
    await_go();
    pthread_setspecific(end_key, thread);
    return self->start(self->argument);
}

int pthread_create(pthread_t *id, const pthread_attr_t *attributes, void *(*start)(void *), void *argument)
{
    if (!self)
        return NEXT(pthread_create)(id, attributes, start, argument);
    struct thread *thread = threads;
    while (thread < threads + thread_count && thread->state != FREE)
        thread++;
    if (thread == threads + THREADS_MAX)
        return EAGAIN;
    if (thread == threads + thread_count)
        thread_count++;
    *thread = (struct thread) { .start = start, .argument = argument, .until_us = NEVER };
    /* Priorities of real time have no meaning here. */
    if (attributes)
        pthread_attr_setinheritsched((pthread_attr_t *)attributes, PTHREAD_INHERIT_SCHED);
    int error = NEXT(pthread_create)(id, attributes, run_thread, thread);
    if (error)
        return error;
    thread->id = *id;
    make_ready(thread);
    return 0;
}

int pthread_setschedparam(pthread_t id, int policy, const struct sched_param *parameter)
{
    return self ? 0 : NEXT(pthread_setschedparam)(id, policy, parameter);
}

static struct thread *thread_of(pthread_t id)
{
    for (struct thread *at = threads; at < threads + thread_count; at++)
        if (at->state != FREE && pthread_equal(at->id, id))
            return at;
    return NULL;
}

int pthread_join(pthread_t id, void **result)
{
    struct thread *thread = self ? thread_of(id) : NULL;
    if (thread && thread != self)
        wait_for(WAITS_END, thread, NEVER);
    return NEXT(pthread_join)(id, result);
}

/* A signal ends a sleep. */
int pthread_kill(pthread_t id, int number)
{
    struct thread *thread = self ? thread_of(id) : NULL;
    if (!thread || number == 0)
        return NEXT(pthread_kill)(id, number);
    if (thread->state == WAITS_TIME)
        make_ready(thread);
    return 0;
}

/* Mutexes. */

int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    if (!self)
        return NEXT(pthread_mutex_lock)(mutex);
    int error;
    while ((error = pthread_mutex_trylock(mutex)) == EBUSY)
        wait_for(WAITS_MUTEX, mutex, NEVER);
    return error;
}

int pthread_mutex_unlock(pthread_mutex_t *mutex)
{
    int error = NEXT(pthread_mutex_unlock)(mutex);
    struct thread *waiter = self && mutex_waiters ? first_waiter(WAITS_MUTEX, mutex) : NULL;
    if (waiter)
        make_ready(waiter);
    return error;
}

/* Conditions. The value of a condition is not used. */

static int wait_condition(pthread_cond_t *condition, pthread_mutex_t *mutex, uint64_t until_us)
{
    pthread_mutex_unlock(mutex);
    wait_for(WAITS_CONDITION, condition, until_us);
    int is_late = self->object != NULL;
    int error = pthread_mutex_lock(mutex);
    return error ? error : is_late ? ETIMEDOUT : 0;
}

static void signal_condition(struct thread *waiter)
{
    waiter->object = NULL;
    make_ready(waiter);
}

int pthread_cond_wait(pthread_cond_t *condition, pthread_mutex_t *mutex)
{
    return self ? wait_condition(condition, mutex, NEVER) : NEXT_CONDITION(pthread_cond_wait)(condition, mutex);
}

static uint64_t microseconds(const struct timespec *time)
{
    return (uint64_t)time->tv_sec * 1000000u + (uint64_t)(time->tv_nsec + 999) / 1000;
}

static uint64_t deadline(clockid_t clock, const struct timespec *time)
{
    uint64_t begin_us = clock == CLOCK_REALTIME ? EPOCH_S * 1000000u : 0;
    uint64_t until_us = microseconds(time);
    return until_us > begin_us ? until_us - begin_us : 0;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *time)
{
    if (!self)
        return NEXT_CONDITION(pthread_cond_timedwait)(condition, mutex, time);
    return wait_condition(condition, mutex, deadline(CLOCK_REALTIME, time));
}

int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock, const struct timespec *time)
{
    if (!self)
        return NEXT(pthread_cond_clockwait)(condition, mutex, clock, time);
    return wait_condition(condition, mutex, deadline(clock, time));
}

int pthread_cond_signal(pthread_cond_t *condition)
{
    if (!self)
        return NEXT_CONDITION(pthread_cond_signal)(condition);
    struct thread *waiter = first_waiter(WAITS_CONDITION, condition);
    if (waiter)
        signal_condition(waiter);
    return 0;
}

int pthread_cond_broadcast(pthread_cond_t *condition)
{
    if (!self)
        return NEXT_CONDITION(pthread_cond_broadcast)(condition);
    struct thread *waiter;
    while ((waiter = first_waiter(WAITS_CONDITION, condition)))
        signal_condition(waiter);
    return 0;
}

/* Time. */

int usleep(useconds_t us)
{
    if (!self)
        return NEXT(usleep)(us);
    wait_for(WAITS_TIME, NULL, now_us + us);
    return 0;
}

unsigned sleep(unsigned seconds)
{
    if (!self)
        return NEXT(sleep)(seconds);
    wait_for(WAITS_TIME, NULL, now_us + seconds * 1000000ull);
    return 0;
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    if (!self)
        return NEXT(nanosleep)(time, left);
    wait_for(WAITS_TIME, NULL, now_us + microseconds(time));
    return 0;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time, struct timespec *left)
{
    if (!self)
        return NEXT(clock_nanosleep)(clock, flags, time, left);
    wait_for(WAITS_TIME, NULL, flags & TIMER_ABSTIME ? deadline(clock, time) : now_us + microseconds(time));
    return 0;
}

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (!self)
        return NEXT(clock_gettime)(clock, time);
    time->tv_sec = (time_t)((clock == CLOCK_REALTIME ? EPOCH_S : 0) + now_us / 1000000u);
    time->tv_nsec = (long)(now_us % 1000000u * 1000u);
    return 0;
}

int gettimeofday(struct timeval *time, void *zone)
{
    if (!self)
        return NEXT(gettimeofday)(time, zone);
    time->tv_sec = (time_t)(EPOCH_S + now_us / 1000000u);
    time->tv_usec = (suseconds_t)(now_us % 1000000u);
    return 0;
}

/* PX4 would set the clock of the host, if it had the right to. */
int clock_settime(clockid_t clock, const struct timespec *time)
{
    return self ? 0 : NEXT(clock_settime)(clock, time);
}

/* Files and sockets. */

static void wait_for_files(struct pollfd *files, nfds_t count, uint64_t until_us)
{
    self->files = files;
    self->file_count = count;
    wait_for(WAITS_FILES, NULL, until_us);
}

/* Waits for the messages of a step. */
static void await_step(void)
{
    while (input_read == input_length)
        wait_for(WAITS_STEP, NULL, NEVER);
}

static int is_simulator(int fd)
{
    return self && fd >= 0 && fd == simulator_fd;
}

/* The declaration of `poll` says that it only writes to the files. */
#ifndef __clang__
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

int poll(struct pollfd *files, nfds_t count, int timeout_ms)
{
    if (!self)
        return NEXT(poll)(files, count, timeout_ms);
    for (nfds_t at = 0; at < count; at++)
        if (is_simulator(files[at].fd)) {
            await_step();
            for (nfds_t other = 0; other < count; other++)
                files[other].revents = 0;
            files[at].revents = POLLIN;
            return 1;
        }
    if (timeout_ms != 0)
        wait_for_files(files, count, timeout_ms < 0 ? NEVER : now_us + (uint64_t)timeout_ms * 1000u);
    int found = NEXT(poll)(files, count, 0);
    /* One file at a time, the last one first: a command that has ended, before the next one, which may or may not have come. */
    for (nfds_t at = count, is_found = 0; at--;) {
        if (is_found)
            files[at].revents = 0;
        is_found |= files[at].revents != 0;
    }
    return found > 1 ? 1 : found;
}

int __poll_chk(struct pollfd *files, nfds_t count, int timeout_ms, size_t size)
{
    (void)size;
    return poll(files, count, timeout_ms);
}

static ssize_t take(void *bytes, size_t size)
{
    await_step();
    size_t length = input_length - input_read;
    length = length < size ? length : size;
    memcpy(bytes, input + input_read, length);
    input_read += length;
    return (ssize_t)length;
}

static ssize_t give(const void *bytes, size_t size)
{
    if (size > sizeof output - output_length)
        give_up("PX4's answers to one step are longer than 65536 bytes");
    memcpy(output + output_length, bytes, size);
    output_length += size;
    return (ssize_t)size;
}

ssize_t read(int fd, void *bytes, size_t size)
{
    if (is_simulator(fd))
        return take(bytes, size);
    int is_from_client = self && fd >= 0 && fd < FILES_MAX && is_client[fd];
    if (is_from_client) {
        struct pollfd file = { fd, POLLIN, 0 };
        wait_for_files(&file, 1, NEVER);
    }
    ssize_t length = NEXT(read)(fd, bytes, size);
    if (is_from_client && length > 0 && !is_command[fd]) {
        is_command[fd] = 1;
        commands++;
    }
    return length;
}

ssize_t __read_chk(int fd, void *bytes, size_t size, size_t all)
{
    (void)all;
    return read(fd, bytes, size);
}

ssize_t recv(int fd, void *bytes, size_t size, int flags)
{
    return is_simulator(fd) ? take(bytes, size) : NEXT(recv)(fd, bytes, size, flags);
}

ssize_t __recv_chk(int fd, void *bytes, size_t size, size_t all, int flags)
{
    (void)all;
    return recv(fd, bytes, size, flags);
}

ssize_t recvfrom(int fd, void *bytes, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    return is_simulator(fd) ? take(bytes, size) : NEXT(recvfrom)(fd, bytes, size, flags, from, length);
}

ssize_t __recvfrom_chk(int fd, void *bytes, size_t size, size_t all, int flags, struct sockaddr *from, socklen_t *length)
{
    (void)all;
    return recvfrom(fd, bytes, size, flags, from, length);
}

ssize_t send(int fd, const void *bytes, size_t size, int flags)
{
    return is_simulator(fd) ? give(bytes, size) : NEXT(send)(fd, bytes, size, flags);
}

ssize_t sendto(int fd, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    return is_simulator(fd) ? give(bytes, size) : NEXT(sendto)(fd, bytes, size, flags, to, length);
}

int accept(int fd, struct sockaddr *from, socklen_t *length)
{
    int client = NEXT(accept)(fd, from, length);
    if (self && client >= 0 && client < FILES_MAX) {
        /* A client before it may have gone without `shutdown`. */
        commands -= is_command[client];
        is_command[client] = 0;
        is_client[client] = 1;
    }
    return client;
}

int shutdown(int fd, int how)
{
    if (self && fd >= 0 && fd < FILES_MAX) {
        commands -= is_command[fd];
        is_command[fd] = is_client[fd] = 0;
    }
    return NEXT(shutdown)(fd, how);
}

/* `path` in the folder above, if PX4 would have it in /tmp. */
static const char *moved(const char *path, char *place, size_t size)
{
    if (strncmp(path, "/tmp/px4_lock", 13) && strncmp(path, "/tmp/px4-sock", 13))
        return path;
    snprintf(place, size, "../%s", path + 5);
    return place;
}

static const struct sockaddr *moved_address(const struct sockaddr *address, struct sockaddr_un *place)
{
    if (address->sa_family != AF_UNIX)
        return address;
    const struct sockaddr_un *from = (const struct sockaddr_un *)address;
    /* The path may lack its final zero. */
    char path[sizeof place->sun_path + 1], new_path[sizeof place->sun_path];
    snprintf(path, sizeof path, "%.*s", (int)sizeof from->sun_path, from->sun_path);
    const char *to = moved(path, new_path, sizeof new_path);
    if (to == path)
        return address;
    *place = (struct sockaddr_un) { .sun_family = AF_UNIX };
    snprintf(place->sun_path, sizeof place->sun_path, "%s", to);
    return (const struct sockaddr *)place;
}

int connect(int fd, const struct sockaddr *address, socklen_t length)
{
    if (self && address->sa_family == AF_INET) {
        int port = ntohs(((const struct sockaddr_in *)address)->sin_port);
        if (port >= FIRST_PORT && port < FIRST_PORT + PORTS) {
            simulator_fd = fd;
            return 0;
        }
    }
    struct sockaddr_un place;
    const struct sockaddr *to = moved_address(address, &place);
    return NEXT(connect)(fd, to, to == address ? length : sizeof place);
}

int bind(int fd, const struct sockaddr *address, socklen_t length)
{
    struct sockaddr_un place;
    const struct sockaddr *at = moved_address(address, &place);
    return NEXT(bind)(fd, at, at == address ? length : sizeof place);
}

int unlink(const char *path)
{
    char place[PATH_MAX];
    return NEXT(unlink)(moved(path, place, sizeof place));
}

#define OPEN(name) \
    int name(const char *path, int flags, ...) \
    { \
        va_list rest; \
        va_start(rest, flags); \
        mode_t mode = flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(rest, mode_t) : 0; \
        va_end(rest); \
        char place[PATH_MAX]; \
        return NEXT(name)(moved(path, place, sizeof place), flags, mode); \
    }
OPEN(open)
OPEN(open64)

/* The start-up script: the first one that PX4 runs. */
int system(const char *line)
{
    if (!self || !line)
        return NEXT(system)(line);
    pid_t child = fork();
    if (child == 0) {
        execl("/bin/sh", "sh", "-c", line, (char *)NULL);
        _exit(127);
    }
    int status, child_fd = child > 0 ? (int)syscall(SYS_pidfd_open, child, 0) : -1;
    if (child_fd < 0)
        return -1;
    struct pollfd file = { child_fd, POLLIN, 0 };
    int is_first = !is_starting && !is_started;
    if (is_first)
        is_starting = 1;
    wait_for_files(&file, 1, NEVER);
    if (is_first) {
        is_starting = 0;
        is_started = 1;
    }
    while (waitpid(child, &status, 0) < 0 && errno == EINTR)
        ;
    close(child_fd);
    return status;
}

__attribute__((constructor)) static void begin(void)
{
    /* Without its parent nobody is left to work for. */
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (strcmp(program_invocation_short_name, "px4"))
        return;
    /* The log of a process that is killed ends with its last line. */
    setvbuf(stdout, NULL, _IOLBF, 0);
    link_fd = fcntl(0, F_DUPFD_CLOEXEC, 100);
    int none = open("/dev/null", O_RDONLY);
    dup2(none, 0);
    close(none);
    pthread_key_create(&end_key, end_thread);
    self = threads;
    self->state = RUNS;
    self->id = pthread_self();
    thread_count = 1;
}
