// The C library of WebAssembly has no clock of a thread: what asks for it goes without (OperationWatch.cpp).
#include <pthread.h>

#include <cerrno>
#include <ctime>

extern "C" int pthread_getcpuclockid(pthread_t, clockid_t*) { return ENOSYS; }
