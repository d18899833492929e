#include "common/confine/SystemCalls.h"

#include <fcntl.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace common {
namespace {

// Files are opened, named and removed as Landlock allows; nothing here changes owners, modes or times.
constexpr int kReaderCalls[] = {SCMP_SYS(read),
                                SCMP_SYS(write),
                                SCMP_SYS(readv),
                                SCMP_SYS(writev),
                                SCMP_SYS(pread64),
                                SCMP_SYS(pwrite64),
                                SCMP_SYS(lseek),
                                SCMP_SYS(close),
                                SCMP_SYS(close_range),
                                SCMP_SYS(fstat),
                                SCMP_SYS(stat),
                                SCMP_SYS(lstat),
                                SCMP_SYS(newfstatat),
                                SCMP_SYS(statx),
                                SCMP_SYS(statfs),
                                SCMP_SYS(fstatfs),
                                SCMP_SYS(access),
                                SCMP_SYS(faccessat),
                                SCMP_SYS(faccessat2),
                                SCMP_SYS(getdents64),
                                SCMP_SYS(readlink),
                                SCMP_SYS(readlinkat),
                                SCMP_SYS(getcwd),
                                SCMP_SYS(fcntl),
                                SCMP_SYS(flock),
                                SCMP_SYS(dup),
                                SCMP_SYS(dup2),
                                SCMP_SYS(dup3),
                                SCMP_SYS(fsync),
                                SCMP_SYS(fdatasync),
                                SCMP_SYS(ftruncate),
                                SCMP_SYS(fallocate),
                                SCMP_SYS(fadvise64),
                                SCMP_SYS(mkdir),
                                SCMP_SYS(mkdirat),
                                SCMP_SYS(rmdir),
                                SCMP_SYS(unlink),
                                SCMP_SYS(unlinkat),
                                SCMP_SYS(rename),
                                SCMP_SYS(renameat),
                                SCMP_SYS(renameat2),
                                SCMP_SYS(umask),
                                SCMP_SYS(brk),
                                SCMP_SYS(munmap),
                                SCMP_SYS(mremap),
                                SCMP_SYS(madvise),
                                SCMP_SYS(msync),
                                SCMP_SYS(mincore),
                                SCMP_SYS(rt_sigaction),
                                SCMP_SYS(rt_sigprocmask),
                                SCMP_SYS(rt_sigreturn),
                                SCMP_SYS(sigaltstack),
                                SCMP_SYS(getitimer),
                                SCMP_SYS(restart_syscall),
                                SCMP_SYS(futex),
                                SCMP_SYS(set_robust_list),
                                SCMP_SYS(get_robust_list),
                                SCMP_SYS(rseq),
                                SCMP_SYS(set_tid_address),
                                SCMP_SYS(arch_prctl),
                                SCMP_SYS(membarrier),
                                SCMP_SYS(poll),
                                SCMP_SYS(ppoll),
                                SCMP_SYS(select),
                                SCMP_SYS(pselect6),
                                SCMP_SYS(nanosleep),
                                SCMP_SYS(clock_nanosleep),
                                SCMP_SYS(clock_gettime),
                                SCMP_SYS(clock_getres),
                                SCMP_SYS(gettimeofday),
                                SCMP_SYS(time),
                                SCMP_SYS(times),
                                SCMP_SYS(getrusage),
                                SCMP_SYS(getrandom),
                                SCMP_SYS(sysinfo),
                                SCMP_SYS(uname),
                                SCMP_SYS(getpid),
                                SCMP_SYS(gettid),
                                SCMP_SYS(getppid),
                                SCMP_SYS(getpgrp),
                                SCMP_SYS(getpgid),
                                SCMP_SYS(getsid),
                                SCMP_SYS(getuid),
                                SCMP_SYS(geteuid),
                                SCMP_SYS(getgid),
                                SCMP_SYS(getegid),
                                SCMP_SYS(getcpu),
                                SCMP_SYS(sched_yield),
                                SCMP_SYS(sched_getaffinity),
                                SCMP_SYS(getrlimit),
                                SCMP_SYS(exit),
                                SCMP_SYS(exit_group)};

// sendto is write() for a socket that is there already.
constexpr int kSimulatorCalls[] = {SCMP_SYS(wait4),
                                   SCMP_SYS(waitid),
                                   SCMP_SYS(pipe),
                                   SCMP_SYS(pipe2),
                                   SCMP_SYS(pidfd_open),
                                   SCMP_SYS(pidfd_send_signal),
                                   SCMP_SYS(kill),
                                   SCMP_SYS(sendto),
                                   SCMP_SYS(recvfrom),
                                   SCMP_SYS(seccomp),
                                   SCMP_SYS(landlock_create_ruleset),
                                   SCMP_SYS(landlock_add_rule),
                                   SCMP_SYS(landlock_restrict_self),
                                   SCMP_SYS(setitimer),
                                   SCMP_SYS(setrlimit),
                                   SCMP_SYS(sched_setaffinity)};

constexpr int kPictureCalls[] = {SCMP_SYS(mmap),
                                 SCMP_SYS(mprotect),
                                 SCMP_SYS(ioctl),
                                 SCMP_SYS(memfd_create),
                                 SCMP_SYS(shutdown),
                                 SCMP_SYS(recvmsg),
                                 SCMP_SYS(sendmsg),
                                 SCMP_SYS(eventfd2),
                                 SCMP_SYS(epoll_wait),
                                 SCMP_SYS(epoll_create1),
                                 SCMP_SYS(epoll_ctl),
                                 SCMP_SYS(sched_getscheduler),
                                 SCMP_SYS(sched_getparam),
                                 SCMP_SYS(sched_get_priority_min),
                                 SCMP_SYS(sched_get_priority_max),
                                 SCMP_SYS(kcmp),
                                 SCMP_SYS(shmdt),
                                 SCMP_SYS(shmctl)};

// Another program, or another process's memory: a reader never tries.
constexpr int kFatalCalls[] = {SCMP_SYS(execve), SCMP_SYS(execveat), SCMP_SYS(ptrace),
                               SCMP_SYS(process_vm_readv), SCMP_SYS(process_vm_writev)};
// The caller falls back to the older call, whose arguments the filter can see.
constexpr int kUnknownCalls[] = {SCMP_SYS(openat2), SCMP_SYS(clone3)};

constexpr int kSignalsItself[] = {SCMP_SYS(tgkill), SCMP_SYS(kill)};

class Filter {
 public:
  Filter() : context_(seccomp_init(SCMP_ACT_ERRNO(EPERM)), seccomp_release) {
    if (!context_) throw std::bad_alloc();
    check(seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_TSYNC, 1));
    check(seccomp_attr_set(context_.get(), SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS));
    check(seccomp_attr_set(context_.get(), SCMP_FLTATR_CTL_OPTIMIZE, 2));
  }
  void allow(std::span<const int> calls) { add(SCMP_ACT_ALLOW, calls); }
  // A call that this architecture or kernel does not have needs no rule.
  void add(std::uint32_t action, std::span<const int> calls) {
    for (const int call : calls)
      if (const int failure = seccomp_rule_add(context_.get(), action, call, 0);
          failure != 0 && failure != -EDOM && failure != -EFAULT)
        check(failure);
  }
  void allow_if(int call, const std::vector<scmp_arg_cmp>& conditions) {
    const int failure =
        seccomp_rule_add_array(context_.get(), SCMP_ACT_ALLOW, call, conditions.size(), conditions.data());
    if (failure != -EDOM && failure != -EFAULT) check(failure);
  }
  void enforce() { check(seccomp_load(context_.get())); }

 private:
  static void check(int failure) {
    if (failure != 0)
      throw std::runtime_error(std::string("the process cannot be confined: seccomp: ") +
                               std::strerror(-failure));
  }
  std::unique_ptr<void, void (*)(scmp_filter_ctx)> context_;
};

scmp_arg_cmp masked(unsigned argument, std::uint64_t mask, std::uint64_t value) {
  return {argument, SCMP_CMP_MASKED_EQ, mask, value};
}

scmp_arg_cmp equal(unsigned argument, std::uint64_t value) { return {argument, SCMP_CMP_EQ, value, 0}; }

// Kernels whose Landlock does not know truncation would empty a file that is open for reading.
void allow_open(Filter& filter) {
  constexpr std::uint64_t kMask = O_ACCMODE | O_TRUNC;
  for (const std::uint64_t flags : {O_RDONLY, O_WRONLY, O_RDWR, O_WRONLY | O_TRUNC, O_RDWR | O_TRUNC}) {
    filter.allow_if(SCMP_SYS(open), {masked(1, kMask, flags)});
    filter.allow_if(SCMP_SYS(openat), {masked(2, kMask, flags)});
  }
  filter.allow_if(SCMP_SYS(creat), {masked(1, 0, 0)});
}

void allow_data_memory(Filter& filter) {
  filter.allow_if(SCMP_SYS(mmap), {masked(2, PROT_EXEC, 0)});
  filter.allow_if(SCMP_SYS(mprotect), {masked(2, PROT_EXEC, 0)});
}

void allow_processes(Filter& filter) {
  constexpr std::uint64_t kNamespaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC |
                                        CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET;
  filter.allow_if(SCMP_SYS(clone), {masked(0, kNamespaces, 0)});
}

}  // namespace

bool has_seccomp() noexcept {
  const std::uint32_t action = SECCOMP_RET_KILL_PROCESS;
  return ::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) == 0;
}

void restrict_calls(Confinement::Calls calls) {
  using Calls = Confinement::Calls;
  if (calls == Calls::kAny) return;
  Filter filter;
  filter.allow(kReaderCalls);
  allow_open(filter);
  for (const unsigned long request : {TCGETS, TIOCGWINSZ, FIONREAD})
    filter.allow_if(SCMP_SYS(ioctl), {equal(1, request)});
  for (const int option : {PR_SET_PDEATHSIG, PR_GET_PDEATHSIG, PR_SET_NAME, PR_GET_NAME, PR_SET_NO_NEW_PRIVS,
                           PR_GET_NO_NEW_PRIVS, PR_SET_SECCOMP, PR_GET_SECCOMP, PR_SET_VMA})
    filter.allow_if(SCMP_SYS(prctl), {equal(0, static_cast<std::uint64_t>(option))});
  if (calls == Calls::kReader) {
    for (const int call : kSignalsItself)
      filter.allow_if(call, {equal(0, static_cast<std::uint64_t>(::getpid()))});
    filter.allow_if(SCMP_SYS(prlimit64), {equal(0, 0), equal(2, 0)});  // its limits stand
  } else {
    filter.allow_if(SCMP_SYS(prlimit64), {equal(0, 0)});
    filter.allow(kSimulatorCalls);
    filter.allow(std::array{SCMP_SYS(tgkill)});
    allow_processes(filter);
  }
  if (calls == Calls::kPictures)
    filter.allow(kPictureCalls);
  else
    allow_data_memory(filter);
  filter.add(SCMP_ACT_KILL_PROCESS, kFatalCalls);
  filter.add(SCMP_ACT_ERRNO(ENOSYS), kUnknownCalls);
  filter.enforce();
}

}  // namespace common
