/* Preloaded into a program, stands for foreign code that an error in a reader runs: at the first call of one
 * of the functions below it tries what a confined process may not do, and prints what each try gave. With
 * ATTACK=NAME it tries that one alone, because some end the process. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/io_uring.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

static char target[3000]; /* a folder that holds .git/config, and in which nothing may be written */

static const char* in_target(const char* name) {
  static char path[4096];
  snprintf(path, sizeof path, "%s/%s", target, name);
  return path;
}

static int open_close(const char* path, int flags) {
  int file = open(path, flags, 0644);
  if (file >= 0) close(file);
  return file;
}

static int append_to_config(void) { return open_close(in_target(".git/config"), O_WRONLY | O_APPEND); }
static int create_file(void) { return open_close(in_target("created"), O_WRONLY | O_CREAT); }
static int truncate_by_reading(void) { return open_close(in_target("kept"), O_RDONLY | O_TRUNC); }
static int truncate_path(void) { return truncate(in_target("kept"), 0); }
static int remove_file(void) { return unlink(in_target("kept")); }
static int rename_file(void) {
  char from[4096];
  strcpy(from, in_target("moved"));
  return rename(from, in_target(".git/hooks"));
}
static int link_file(void) {
  char from[4096];
  strcpy(from, in_target(".git/config"));
  return link(from, in_target("linked"));
}
static int symlink_file(void) { return symlink("/etc/passwd", in_target("symlinked")); }
static int make_folder(void) { return mkdir(in_target("made"), 0755); }
static int change_mode(void) { return chmod(in_target("kept"), 0777); }
static int change_times(void) { return utimensat(AT_FDCWD, in_target("kept"), NULL, 0); }
static int read_passwords(void) { return open_close("/etc/passwd", O_RDONLY); }
static int read_by_link(void) { return open_close(in_target("link-to-passwd"), O_RDONLY); }
static int read_environment(void) {
  char path[64];
  snprintf(path, sizeof path, "/proc/%d/environ", getppid());
  int file = open(path, O_RDONLY);
  if (file < 0) return -1;
  char byte;
  int bytes = (int)read(file, &byte, 1);
  close(file);
  if (bytes == 0) errno = EACCES;
  return bytes == 1 ? 0 : -1;
}
static int create_in_shm(void) {
  int file = open_close("/dev/shm/smartsurf-test-attack", O_RDWR | O_CREAT);
  if (file >= 0) unlink("/dev/shm/smartsurf-test-attack");
  return file;
}
static int open_by_openat2(void) {
  struct {
    unsigned long long flags, mode, resolve;
  } how = {O_WRONLY | O_CREAT, 0644, 0};
  int file = (int)syscall(SYS_openat2, AT_FDCWD, in_target("opened2"), &how, sizeof how);
  if (file >= 0) close(file);
  return file;
}
static int inet_socket(void) { return socket(AF_INET, SOCK_STREAM, 0); }
static int unix_socket(void) { return socket(AF_UNIX, SOCK_STREAM, 0); }
static int signal_parent(void) { return kill(getppid(), 0); }
static int new_user_namespace(void) { return (int)syscall(SYS_unshare, 0x10000000); }
static int executable_memory(void) {
  void* at = mmap(NULL, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  return at == MAP_FAILED ? -1 : 0;
}
static int memory_file(void) { return memfd_create("attack", 0); }
static int io_ring(void) {
  struct io_uring_params parameters;
  memset(&parameters, 0, sizeof parameters);
  return (int)syscall(SYS_io_uring_setup, 4, &parameters);
}
static int execute(void) {
  char* arguments[] = {"/bin/true", NULL};
  return execv("/bin/true", arguments);
}
static int execute_in_child(void) {
  int status = 0;
  pid_t child = fork();
  if (child < 0) return -1;
  if (child == 0) {
    execute();
    _exit(99);
  }
  waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return 0;
  errno = EPERM;
  return -1;
}
static int trace_itself(void) { return (int)ptrace(PTRACE_TRACEME, 0, NULL, NULL); }

static const struct {
  const char* name;
  int (*run)(void);
  int alone; /* may end the process */
} attacks[] = {{"append_to_config", append_to_config, 0},
               {"create_file", create_file, 0},
               {"read_passwords", read_passwords, 0},
               {"read_by_link", read_by_link, 0},
               {"read_environment", read_environment, 0},
               {"create_in_shm", create_in_shm, 0},
               {"open_by_openat2", open_by_openat2, 0},
               {"link_file", link_file, 0},
               {"symlink_file", symlink_file, 0},
               {"make_folder", make_folder, 0},
               {"change_mode", change_mode, 0},
               {"change_times", change_times, 0},
               {"truncate_by_reading", truncate_by_reading, 0},
               {"truncate_path", truncate_path, 0},
               {"inet_socket", inet_socket, 0},
               {"unix_socket", unix_socket, 0},
               {"signal_parent", signal_parent, 0},
               {"new_user_namespace", new_user_namespace, 0},
               {"executable_memory", executable_memory, 0},
               {"memory_file", memory_file, 0},
               {"io_ring", io_ring, 0},
               {"rename_file", rename_file, 0},
               {"remove_file", remove_file, 0},
               {"execute_in_child", execute_in_child, 0},
               {"execute", execute, 1},
               {"trace_itself", trace_itself, 1}};

static void attack(int report) {
  static int done = 0;
  const char* folder = getenv("ATTACK_TARGET");
  const char* alone = getenv("ATTACK");
  char text[4096] = "";
  if (done++ || folder == NULL) return;
  snprintf(target, sizeof target, "%s", folder);
  for (size_t i = 0; i < sizeof attacks / sizeof attacks[0]; ++i) {
    if (alone != NULL ? strcmp(alone, attacks[i].name) != 0 : attacks[i].alone) continue;
    errno = 0;
    const int result = attacks[i].run();
    const char* outcome = result >= 0 ? "done"
                          : errno == EACCES || errno == EPERM || errno == ENOSYS || errno == EXDEV
                              ? "refused"
                              : strerror(errno);
    snprintf(text + strlen(text), sizeof text - strlen(text), "%s=%s ", attacks[i].name, outcome);
  }
  strcat(text, "\n");
  if (write(report, text, strlen(text)) < 0) _exit(98);
}

static void* next(const char* name) {
  void* function = dlsym(RTLD_NEXT, name);
  if (function == NULL) _exit(97);
  return function;
}

/* A script is compiled. */
int lua_load(void* state, void* reader, void* data, const char* chunk, const char* mode) {
  int (*real)(void*, void*, void*, const char*, const char*) = next("lua_load");
  attack(STDERR_FILENO);
  return real(state, reader, data, chunk, mode);
}

/* A recording is opened, in a process whose standard streams lead nowhere or in the command's own. */
int64_t H5Fopen(const char* name, unsigned flags, int64_t access) {
  int64_t (*real)(const char*, unsigned, int64_t) = next("H5Fopen");
  struct stat status, nowhere;
  if (fstat(STDERR_FILENO, &status) != 0 || stat("/dev/null", &nowhere) != 0 ||
      status.st_rdev != nowhere.st_rdev)
    attack(STDERR_FILENO);
  return real(name, flags, access);
}

/* A mesh is imported, in a process that returns 'e' and a message by descriptor 3. */
const void* _ZN6Assimp8Importer8ReadFileEPKcj(void* importer, const char* file, unsigned flags) {
  const void* (*real)(void*, const char*, unsigned) = next("_ZN6Assimp8Importer8ReadFileEPKcj");
  if (getenv("ATTACK_MESH") != NULL) {
    if (write(3, "e", 1) != 1) _exit(98);
    attack(3);
    _exit(0);
  }
  return real(importer, file, flags);
}

/* A chart is drawn. */
void* cairo_svg_surface_create_for_stream(void* write, void* closure, double width, double height) {
  void* (*real)(void*, void*, double, double) = next("cairo_svg_surface_create_for_stream");
  if (getenv("ATTACK_CHART") != NULL) attack(STDERR_FILENO);
  return real(write, closure, width, height);
}

/* An APRON program prints. */
int fflush(FILE* stream) {
  int (*real)(FILE*) = next("fflush");
  if (getenv("ATTACK_APRON") != NULL && stream == stdout) attack(STDERR_FILENO);
  return real(stream);
}
