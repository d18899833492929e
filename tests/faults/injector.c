/* clang-format off */
/* Fails the n-th call of a kind of system function; preloaded into a program by scripts/check-faults.
 *
 *   FAULT_PROGRAM  the only program that faults are injected into; other processes that inherit the environment run as ever
 *   FAULT_KIND     alloc open read write fsync mmap ftruncate rename thread process futex park; futex: a wait with a
 *                  time limit, as the protocol's; park: without one, as std::atomic's
 *   FAULT_AT       number of the call that fails, from 1, counted from the start of main()
 *   FAULT_ERRNO    error number of the call; 0: read or write transfers half of the bytes
 *   FAULT_ALWAYS   set: all later calls of the kind fail as well
 *   FAULT_TRACE    file that receives the call stack of the fault
 *   FAULT_CENSUS   file that receives, for each kind, the number of calls and each call as NUMBER:LIBRARY, with the library that
 *                  called, and a star if it is the first from its stack; nothing fails. With FAULT_KIND, which may then
 *                  be a list, of these kinds only
 *   FAULT_FOLLOW   set: the first process that the program forks does its work, and its calls are those of the census
 *   FAULT_SERVER   set: the process waits before main() for the runs that it is asked for, each in a child (serve())
 *
 * Not seen: calls that the C library makes by itself (stdio, the stack of a thread, sleeps of its locks). A forked child
 * inherits the count.
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <linux/futex.h>
#include <pthread.h>
#include <spawn.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>
#include <unwind.h>

enum Kind {
  kAlloc,
  kOpen,
  kRead,
  kWrite,
  kFsync,
  kMmap,
  kFtruncate,
  kRename,
  kThread,
  kProcess,
  kFutex,
  kPark,
  kKinds
};
static const char* const kNames[kKinds] = {"alloc",     "open",   "read",   "write",   "fsync", "mmap",
                                           "ftruncate", "rename", "thread", "process", "futex", "park"};

extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);

static atomic_bool armed;
static enum Kind kind = kKinds;
static uint64_t fail_at;
static int fault_errno;
static bool always;
static const char *trace, *census;
static bool counted[kKinds]; /* by the census */
static pid_t counted_process;
static atomic_uint_fast64_t calls[kKinds];
/* Set while the injector itself runs, whose calls do not count. */
static __thread bool inside __attribute__((tls_model("initial-exec")));

/* ---- census: the calls and their stacks ------------------------------------------------------------------------- */
enum { kDepth = 32, kHashedFrames = 8, kSites = 1 << 17, kListed = 1 << 22 };
struct Site {
  uint64_t hash, first;
  uintptr_t caller;
  enum Kind kind;
};
static struct Site sites[kSites];
static uint32_t listed[kListed];  /* sites of all calls, in the order of the calls of all kinds */
static uint64_t numbers[kListed]; /* of those calls among the calls of their kind */
static size_t listed_calls;
static pthread_mutex_t sites_mutex = PTHREAD_MUTEX_INITIALIZER;

struct Stack {
  uintptr_t frames[kDepth];
  int depth;
};

static _Unwind_Reason_Code add_frame(struct _Unwind_Context* context, void* of) {
  struct Stack* stack = of;
  if (stack->depth == kDepth) return _URC_END_OF_STACK;
  stack->frames[stack->depth++] = _Unwind_GetIP(context);
  return _URC_NO_REASON;
}

/* Address of the innermost frame that is neither the injector's nor the C or C++ library's. */
static uintptr_t calling_frame(const struct Stack* stack) {
  for (int i = 0; i < stack->depth; ++i) {
    Dl_info info;
    if (!dladdr((void*)stack->frames[i], &info) || !info.dli_fname) continue;
    if (!strstr(info.dli_fname, "fault_injector") && !strstr(info.dli_fname, "/libc.so") &&
        !strstr(info.dli_fname, "/libstdc++") && !strstr(info.dli_fname, "/ld-linux") &&
        !strstr(info.dli_fname, "/libgcc_s"))
      return stack->frames[i];
  }
  return stack->depth ? stack->frames[stack->depth - 1] : 0;
}

static void note_site(enum Kind of, uint64_t call) {
  struct Stack stack = {.depth = 0};
  _Unwind_Backtrace(add_frame, &stack);
  uint64_t hash = 0xcbf29ce484222325u + of;
  for (int i = 0; i < stack.depth && i < kHashedFrames; ++i) hash = (hash ^ stack.frames[i]) * 0x100000001b3u;
  pthread_mutex_lock(&sites_mutex);
  for (size_t i = hash % kSites, tries = 0; tries < kSites; i = (i + 1) % kSites, ++tries) {
    if (sites[i].first == 0) sites[i] = (struct Site){hash, call, calling_frame(&stack), of};
    if (sites[i].hash != hash) continue;
    if (listed_calls < kListed) {
      numbers[listed_calls] = call;
      listed[listed_calls++] = (uint32_t)i;
    }
    break;
  }
  pthread_mutex_unlock(&sites_mutex);
}

static void write_census(void) {
  FILE* file = fopen(census, "w");
  if (!file) return;
  for (int k = 0; k < kKinds; ++k) {
    fprintf(file, "%s %llu", kNames[k], (unsigned long long)atomic_load(&calls[k]));
    for (size_t i = 0; i < listed_calls; ++i) {
      const struct Site* site = &sites[listed[i]];
      if ((int)site->kind != k) continue;
      Dl_info info;
      const char* library = dladdr((void*)site->caller, &info) && info.dli_fname ? info.dli_fname : "?";
      const char* slash = strrchr(library, '/');
      fprintf(file, " %llu:%s%s", (unsigned long long)numbers[i], slash ? slash + 1 : library,
              site->first == numbers[i] ? "*" : "");
    }
    fputc('\n', file);
  }
  fclose(file);
}

/* ---- the fault -------------------------------------------------------------------------------------------------- */
static void write_trace(void) {
  const int file = open(trace, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  void* frames[kDepth];
  if (file < 0) return;
  backtrace_symbols_fd(frames, backtrace(frames, kDepth), file);
  close(file);
}

/* True if this call of the kind is to fail; errno is then set. */
static bool fails(enum Kind of) {
  if (!atomic_load_explicit(&armed, memory_order_relaxed) || inside || (census ? !counted[of] : of != kind))
    return false;
  const uint64_t call = atomic_fetch_add(&calls[of], 1) + 1;
  if (census) {
    inside = true;
    note_site(of, call);
    inside = false;
    return false;
  }
  if (always ? call < fail_at : call != fail_at) return false;
  if (trace && call == fail_at) {
    inside = true;
    write_trace();
    inside = false;
  }
  errno = fault_errno;
  return true;
}

/* ---- runs ------------------------------------------------------------------------------------------------------- */

/* A request is a line of fields that tabs separate: a folder to run in, files for standard output and standard error, a limit of
 * the address space in kB or 0, environment variables NAME=VALUE, "--", the arguments of the program. The answers to each, on
 * standard output: the number of the child process, which leads a session of its own, and, when it has ended, its status as
 * wait() returns it. Loading the program and its libraries, half of a short run's time, is done once. Returns in the child. */
static void serve(int* argc, char*** argv) {
  static char request[1 << 14], *arguments[256];
  unsetenv("FAULT_SERVER");
  while (fgets(request, sizeof request, stdin)) {
    const pid_t child = fork();
    if (child == 0) break;
    printf("%d\n", (int)child);
    fflush(stdout);
    int status = 0;
    waitpid(child, &status, 0);
    printf("%d\n", status);
    fflush(stdout);
  }
  if (feof(stdin) || ferror(stdin)) _exit(0);
  setsid();
  request[strcspn(request, "\n")] = 0;
  const char* folder = strtok(request, "\t");
  const char* streams[3] = {"/dev/null", strtok(NULL, "\t"), strtok(NULL, "\t")};
  for (int i = 0; i < 3; ++i) {
    const int file = open(streams[i], i == 0 ? O_RDONLY : O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (file < 0 || dup2(file, i) < 0) _exit(99);
    close(file);
  }
  if (chdir(folder) != 0) _exit(99);
  const rlim_t limit = strtoull(strtok(NULL, "\t"), NULL, 10) << 10;
  for (char* field; (field = strtok(NULL, "\t")) && strcmp(field, "--") != 0;) putenv(field);
  arguments[0] = (*argv)[0];
  for (*argc = 1; *argc < 255 && (arguments[*argc] = strtok(NULL, "\t")); ++*argc) {
  }
  *argv = arguments;
  if (limit != 0 && setrlimit(RLIMIT_AS, &(struct rlimit){limit, limit}) != 0) _exit(99);
}

static int (*program_main)(int, char**, char**);
static bool follow;

static int counted_main(int argc, char** argv, char** environment) {
  void* warm_up[1];
  backtrace(warm_up, 1); /* loads the unwinder, which allocates */
  if (getenv("FAULT_SERVER")) {
    serve(&argc, &argv);
    environment = environ;
  }
  const char* program = getenv("FAULT_PROGRAM");
  if (program && strcmp(program, program_invocation_short_name) == 0) {
    const char* text = getenv("FAULT_KIND");
    for (int k = 0; k < kKinds; ++k) {
      counted[k] = !text || strstr(text, kNames[k]);
      if (text && strcmp(text, kNames[k]) == 0) kind = (enum Kind)k;
    }
    if ((text = getenv("FAULT_AT"))) fail_at = strtoull(text, NULL, 10);
    if ((text = getenv("FAULT_ERRNO"))) fault_errno = atoi(text);
    always = getenv("FAULT_ALWAYS") != NULL;
    trace = getenv("FAULT_TRACE");
    census = getenv("FAULT_CENSUS");
    follow = getenv("FAULT_FOLLOW") != NULL;
    counted_process = getpid();
    atomic_store(&armed, true);
  }
  return program_main(argc, argv, environment);
}

/* Destructors of the program and its other libraries have run by then. */
__attribute__((destructor)) static void finish(void) {
  if (!atomic_exchange(&armed, false) || getpid() != counted_process) return;
  if (census) write_census();
}

#define REAL(name) ((__typeof__(&name))real(&next_##name, #name))
#define NEXT(name) static void* next_##name
static void* real(void** address, const char* name) {
  if (!*address) *address = dlsym(RTLD_NEXT, name);
  return *address;
}

typedef int StartMain(int (*)(int, char**, char**), int, char**, void (*)(void), void (*)(void),
                      void (*)(void), void*);
int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(void),
                      void (*fini)(void), void (*rtld_fini)(void), void* stack_end) {
  program_main = main;
  StartMain* start = (StartMain*)dlsym(RTLD_NEXT, "__libc_start_main");
  return start(counted_main, argc, argv, init, fini, rtld_fini, stack_end);
}

/* ---- memory ----------------------------------------------------------------------------------------------------- */
void* malloc(size_t size) { return fails(kAlloc) ? NULL : __libc_malloc(size); }
void* calloc(size_t count, size_t size) { return fails(kAlloc) ? NULL : __libc_calloc(count, size); }
void* realloc(void* old, size_t size) { return fails(kAlloc) ? NULL : __libc_realloc(old, size); }
void* memalign(size_t alignment, size_t size) {
  return fails(kAlloc) ? NULL : __libc_memalign(alignment, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  return fails(kAlloc) ? NULL : __libc_memalign(alignment, size);
}
int posix_memalign(void** result, size_t alignment, size_t size) {
  if (fails(kAlloc)) return ENOMEM;
  void* memory = __libc_memalign(alignment, size);
  if (!memory) return ENOMEM;
  *result = memory;
  return 0;
}

#define MMAP(name, offset_type)                                                                  \
  NEXT(name);                                                                                    \
  void* name(void* at, size_t length, int protection, int flags, int file, offset_type offset) { \
    return fails(kMmap) ? MAP_FAILED : REAL(name)(at, length, protection, flags, file, offset);  \
  }
MMAP(mmap, off_t)
MMAP(mmap64, off64_t)

/* ---- files ------------------------------------------------------------------------------------------------------ */
#define MODE(flags, last)                  \
  mode_t mode = 0;                         \
  if ((flags) & (O_CREAT | __O_TMPFILE)) { \
    va_list list;                          \
    va_start(list, last);                  \
    mode = va_arg(list, mode_t);           \
    va_end(list);                          \
  }
#define OPEN(name)                                            \
  NEXT(name);                                                 \
  int name(const char* path, int flags, ...) {                \
    MODE(flags, flags)                                        \
    return fails(kOpen) ? -1 : REAL(name)(path, flags, mode); \
  }
#define OPENAT(name)                                                  \
  NEXT(name);                                                         \
  int name(int folder, const char* path, int flags, ...) {            \
    MODE(flags, flags)                                                \
    return fails(kOpen) ? -1 : REAL(name)(folder, path, flags, mode); \
  }
OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)

#define FOPEN(name) \
  NEXT(name);       \
  FILE* name(const char* path, const char* mode) { return fails(kOpen) ? NULL : REAL(name)(path, mode); }
FOPEN(fopen)
FOPEN(fopen64)
NEXT(opendir);
DIR* opendir(const char* path) { return fails(kOpen) ? NULL : REAL(opendir)(path); }

static bool is_short(size_t* bytes) {
  if (fault_errno != 0) return false;
  *bytes = (*bytes + 1) / 2;
  return true;
}
/* A program whose last line cannot be written has nowhere to say so. */
#define TRANSFER(name, kind, byte_type)                                                                     \
  NEXT(name);                                                                                               \
  ssize_t name(int file, byte_type* bytes, size_t count) {                                                  \
    return file != STDERR_FILENO && fails(kind) && !is_short(&count) ? -1 : REAL(name)(file, bytes, count); \
  }
TRANSFER(read, kRead, void)
TRANSFER(write, kWrite, const void)
#define TRANSFER_AT(name, kind, byte_type, offset_type)                                \
  NEXT(name);                                                                          \
  ssize_t name(int file, byte_type* bytes, size_t count, offset_type at) {             \
    return fails(kind) && !is_short(&count) ? -1 : REAL(name)(file, bytes, count, at); \
  }
TRANSFER_AT(pread, kRead, void, off_t)
TRANSFER_AT(pread64, kRead, void, off64_t)
TRANSFER_AT(pwrite, kWrite, const void, off_t)
TRANSFER_AT(pwrite64, kWrite, const void, off64_t)
TRANSFER_AT(recv, kRead, void, int)
TRANSFER_AT(send, kWrite, const void, int)
NEXT(writev);
ssize_t writev(int file, const struct iovec* parts, int count) {
  if (!fails(kWrite)) return REAL(writev)(file, parts, count);
  size_t half = count > 0 ? parts[0].iov_len : 0;
  return is_short(&half) && half > 0 ? REAL(write)(file, parts[0].iov_base, half) : -1;
}

NEXT(fsync);
int fsync(int file) { return fails(kFsync) ? -1 : REAL(fsync)(file); }
NEXT(fdatasync);
int fdatasync(int file) { return fails(kFsync) ? -1 : REAL(fdatasync)(file); }
NEXT(msync);
int msync(void* at, size_t length, int flags) { return fails(kFsync) ? -1 : REAL(msync)(at, length, flags); }

#define TRUNCATE(name, offset_type) \
  NEXT(name);                       \
  int name(int file, offset_type length) { return fails(kFtruncate) ? -1 : REAL(name)(file, length); }
TRUNCATE(ftruncate, off_t)
TRUNCATE(ftruncate64, off64_t)
#define FALLOCATE(name, offset_type)                                      \
  NEXT(name);                                                             \
  int name(int file, int mode, offset_type from, offset_type length) {    \
    return fails(kFtruncate) ? -1 : REAL(name)(file, mode, from, length); \
  }
FALLOCATE(fallocate, off_t)
FALLOCATE(fallocate64, off64_t)
#define POSIX_FALLOCATE(name, offset_type)                                   \
  NEXT(name);                                                                \
  int name(int file, offset_type from, offset_type length) {                 \
    return fails(kFtruncate) ? fault_errno : REAL(name)(file, from, length); \
  }
POSIX_FALLOCATE(posix_fallocate, off_t)
POSIX_FALLOCATE(posix_fallocate64, off64_t)

NEXT(rename);
int rename(const char* from, const char* to) { return fails(kRename) ? -1 : REAL(rename)(from, to); }
NEXT(renameat2);
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  return fails(kRename) ? -1 : REAL(renameat2)(from_folder, from, to_folder, to, flags);
}

/* ---- threads, processes, waits ---------------------------------------------------------------------------------- */
NEXT(pthread_create);
int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
                   void* argument) {
  return fails(kThread) ? fault_errno : REAL(pthread_create)(thread, attributes, start, argument);
}
NEXT(fork);
pid_t fork(void) {
  const pid_t child = fails(kProcess) ? -1 : REAL(fork)();
  if (child > 0 && follow && getpid() == counted_process) atomic_store(&armed, false);
  return child;
}

NEXT(_exit);
void _exit(int status) {
  if (follow && getpid() != counted_process && atomic_exchange(&armed, false) && census) write_census();
  REAL(_exit)(status);
  __builtin_unreachable();
}
#define SPAWN(name)                                                                                   \
  NEXT(name);                                                                                         \
  int name(pid_t* child, const char* path, const posix_spawn_file_actions_t* actions,                 \
           const posix_spawnattr_t* attributes, char* const arguments[], char* const environment[]) { \
    return fails(kProcess) ? fault_errno                                                              \
                           : REAL(name)(child, path, actions, attributes, arguments, environment);    \
  }
SPAWN(posix_spawn)
SPAWN(posix_spawnp)

NEXT(syscall);
long syscall(long number, ...) {
  long a[6];
  va_list list;
  va_start(list, number);
  for (int i = 0; i < 6; ++i) a[i] = va_arg(list, long);
  va_end(list);
  const int operation = (int)a[1] & FUTEX_CMD_MASK;
  if (number == SYS_futex && (operation == FUTEX_WAIT || operation == FUTEX_WAIT_BITSET) &&
      fails(a[3] == 0 ? kPark : kFutex))
    return -1;
  return REAL(syscall)(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}
