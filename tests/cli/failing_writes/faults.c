/* Library for LD_PRELOAD: one call that changes the file system fails.
 *
 * FAULT_CALL   number of the call that fails, from 1
 * FAULT_CODE   its errno
 * FAULT_LASTS  if set, all calls from that one on fail
 * FAULT_MARK   file to which the name of each failed call is appended
 *
 * Counted are calls on regular files and folders: pipes and terminals always work. Removing always works.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long calls;
static long failing_call, code;
static int lasts;
static const char *mark;

__attribute__((constructor)) static void begin(void)
{
    const char *call = getenv("FAULT_CALL"), *number = getenv("FAULT_CODE");
    failing_call = call ? atol(call) : 0;
    code = number ? atol(number) : EIO;
    lasts = getenv("FAULT_LASTS") != NULL;
    mark = getenv("FAULT_MARK");
}

/* Whether this call fails; errno is then set. */
static int fails(const char *name)
{
    if (failing_call == 0)
        return 0;
    long call = atomic_fetch_add(&calls, 1) + 1;
    if (call != failing_call && !(lasts && call > failing_call))
        return 0;
    if (mark) {
        int fd = syscall(SYS_openat, AT_FDCWD, mark, O_WRONLY | O_CREAT | O_APPEND, 0644);
        syscall(SYS_write, fd, name, strlen(name));
        syscall(SYS_write, fd, "\n", 1);
        syscall(SYS_close, fd);
    }
    errno = code;
    return 1;
}

static int fails_on(const char *name, int fd)
{
    struct stat about;
    if (fstat(fd, &about) != 0 || !(S_ISREG(about.st_mode) || S_ISDIR(about.st_mode)))
        return 0;
    return fails(name);
}

static int creates(int flags)
{
    return (flags & O_CREAT) || (flags & O_TMPFILE) == O_TMPFILE;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

#define ON_FILE(type, name, parameters, arguments)                                                                     \
    type name parameters                                                                                               \
    {                                                                                                                  \
        return fails_on(#name, fd) ? -1 : NEXT(name) arguments;                                                        \
    }

ON_FILE(ssize_t, write, (int fd, const void *data, size_t count), (fd, data, count))
ON_FILE(ssize_t, writev, (int fd, const struct iovec *data, int count), (fd, data, count))
ON_FILE(ssize_t, pwrite, (int fd, const void *data, size_t count, off_t at), (fd, data, count, at))
ON_FILE(ssize_t, pwrite64, (int fd, const void *data, size_t count, off64_t at), (fd, data, count, at))
ON_FILE(int, fsync, (int fd), (fd))
ON_FILE(int, fdatasync, (int fd), (fd))
ON_FILE(int, ftruncate, (int fd, off_t size), (fd, size))
ON_FILE(int, ftruncate64, (int fd, off64_t size), (fd, size))

ssize_t copy_file_range(int in, off64_t *from, int out, off64_t *to, size_t count, unsigned flags)
{
    return fails_on("copy_file_range", out) ? -1 : NEXT(copy_file_range)(in, from, out, to, count, flags);
}

#define ON_NAME(name, parameters, arguments)                                                                           \
    int name parameters                                                                                                \
    {                                                                                                                  \
        return fails(#name) ? -1 : NEXT(name) arguments;                                                               \
    }

ON_NAME(rename, (const char *from, const char *to), (from, to))
ON_NAME(renameat, (int at, const char *from, int there, const char *to), (at, from, there, to))
ON_NAME(renameat2, (int at, const char *from, int there, const char *to, unsigned flags), (at, from, there, to, flags))
ON_NAME(link, (const char *from, const char *to), (from, to))
ON_NAME(linkat, (int at, const char *from, int there, const char *to, int flags), (at, from, there, to, flags))
ON_NAME(mkdir, (const char *path, mode_t mode), (path, mode))
ON_NAME(mkdirat, (int at, const char *path, mode_t mode), (at, path, mode))

static mode_t mode_of(int flags, va_list more)
{
    return creates(flags) ? va_arg(more, mode_t) : 0;
}

#define OPEN(name)                                                                                                     \
    int name(const char *path, int flags, ...)                                                                         \
    {                                                                                                                  \
        va_list more;                                                                                                  \
        va_start(more, flags);                                                                                         \
        mode_t mode = mode_of(flags, more);                                                                            \
        va_end(more);                                                                                                  \
        return creates(flags) && fails(#name) ? -1 : NEXT(name)(path, flags, mode);                                    \
    }

OPEN(open)
OPEN(open64)

#define OPEN_AT(name)                                                                                                  \
    int name(int at, const char *path, int flags, ...)                                                                 \
    {                                                                                                                  \
        va_list more;                                                                                                  \
        va_start(more, flags);                                                                                         \
        mode_t mode = mode_of(flags, more);                                                                            \
        va_end(more);                                                                                                  \
        return creates(flags) && fails(#name) ? -1 : NEXT(name)(at, path, flags, mode);                                \
    }

OPEN_AT(openat)
OPEN_AT(openat64)
