/* The part of a GPU driver that `gpu_driver` calls, on the processor's memory: a launch calls back whoever has set a kernel.
   Everything is counted, and can be told to fail. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef void (*kernel)(void **parameters, unsigned blocks, unsigned threads);

int fake_devices = 1, fake_capability = 90, fake_fails = 0, fake_bad_text = 0;
size_t fake_free = 1 << 30;
int64_t fake_held = 0, fake_most = 0, fake_launches = 0, fake_events = 0;
kernel fake_kernel = NULL, fake_first = NULL;
static int current = 0;

int cuInit(unsigned flags) { return flags != 0; }
int cuGetErrorString(int code, const char **text) { *text = code == 2 ? "out of memory" : "something else"; return 0; }
int cuDeviceGetCount(int *count) { *count = fake_devices; return 0; }
int cuDeviceGet(int *device, int number) { *device = 40 + number; return number < 0 || number >= fake_devices; }
int cuDeviceGetName(char *name, int size, int device)
{
    strncpy(name, "Processor in disguise", (size_t)size);
    return device < 40;
}
int cuDeviceGetAttribute(int *value, int attribute, int device)
{
    *value = attribute == 16 ? 1 : attribute == 75 ? fake_capability / 10 : fake_capability % 10;
    return device < 40 || (attribute != 16 && attribute != 75 && attribute != 76);
}
int cuDevicePrimaryCtxRetain(void **context, int device) { *context = (void *)(uintptr_t)(device + 100); return device < 40; }
int cuCtxSetCurrent(void *context) { current = (uintptr_t)context == 140; return !current; }
int cuModuleLoadDataEx(void **module, const char *text, unsigned count, const int *options, void **values)
{
    if (!current || count < 2 || options[0] != 5 || options[1] != 6 || (count == 3 && options[2] != 0) || count > 3 || !strstr(text, ".entry lanes"))
        return 1;
    if (fake_bad_text) {
        strncpy(values[0], "line 7: no such\n instruction", (size_t)(uintptr_t)values[1]);
        return 218;
    }
    *module = (void *)1;
    return 0;
}
int cuModuleGetFunction(void **function, void *module, const char *name)
{
    *function = strcmp(name, "lanes") == 0 ? (void *)2 : (void *)3;
    return module != (void *)1 || (strcmp(name, "lanes") != 0 && strcmp(name, "uniforms_of_all") != 0);
}
int cuMemGetInfo_v2(size_t *free_bytes, size_t *total) { *free_bytes = fake_free; *total = 1 << 30; return 0; }
int cuMemAlloc_v2(uint64_t *address, size_t size)
{
    size_t *found;
    if (fake_fails)
        return 2;
    found = aligned_alloc(256, (size + 511) / 256 * 256);
    *found = size;
    memset(found + 32, 0xFF, size); /* whole numbers of -1 and numbers that are none: what is read must have been written */
    *address = (uint64_t)(uintptr_t)(found + 32);
    fake_held += (int64_t)size;
    if (fake_held > fake_most)
        fake_most = fake_held;
    return 0;
}
int cuMemFree_v2(uint64_t address)
{
    size_t *found = (size_t *)(uintptr_t)address - 32;
    fake_held -= (int64_t)*found;
    free(found);
    return 0;
}
int cuMemcpyHtoD_v2(uint64_t to, const void *from, size_t size) { memcpy((void *)(uintptr_t)to, from, size); return 0; }
int cuMemcpyDtoH_v2(void *to, uint64_t from, size_t size) { memcpy(to, (const void *)(uintptr_t)from, size); return 0; }
int cuLaunchKernel(void *function, unsigned bx, unsigned by, unsigned bz, unsigned tx, unsigned ty, unsigned tz, unsigned shared,
                   void *stream, void **parameters, void **extra)
{
    kernel called = function == (void *)2 ? fake_kernel : function == (void *)3 ? fake_first : NULL;
    if (by != 1 || bz != 1 || ty != 1 || tz != 1 || shared || stream || extra || !called)
        return 1;
    if (called == fake_kernel)
        ++fake_launches;
    called(parameters, bx, tx);
    return 0;
}
int cuEventCreate(void **event, unsigned flags) { *event = malloc(1); ++fake_events; return flags != 0; }
int cuEventRecord(void *event, void *stream) { return !event || stream; }
int cuEventSynchronize(void *event) { return !event; }
int cuEventElapsedTime(float *milliseconds, void *begin, void *end) { *milliseconds = 2.0f; return !begin || !end; }
int cuEventDestroy_v2(void *event) { free(event); --fake_events; return 0; }
