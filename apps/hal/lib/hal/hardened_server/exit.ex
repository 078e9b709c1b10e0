defmodule Hal.HardenedServer.Exit do
  @moduledoc false
  # Describes how the process of a `Hal.HardenedServer` ends: it calls the module's `terminate/2`, reports the
  # reason as `GenServer` does, unless it is an ordinary one, and exits with it.

  @typep process :: %{name: term(), module: module(), state: term()}

  @doc "Ends the process for a reason that the module or its parent gave."
  @spec asked(reason :: term(), message :: term(), process()) :: no_return()
  def asked(reason, message, p) do
    terminate(p, reason)
    report(reason, message, p)
    exit(reason)
  end

  @doc "The same; the caller gets its answer after the module has ended."
  @spec answered(reason :: term(), message :: term(), {GenServer.from(), term()}, process()) ::
          no_return()
  def answered(reason, message, {from, answer}, p) do
    terminate(p, reason)
    GenServer.reply(from, answer)
    report(reason, message, p)
    exit(reason)
  end

  @doc "Ends the process because a callback raised, threw or exited."
  @spec crash(:error | :exit, term(), Exception.stacktrace(), message :: term(), process()) ::
          no_return()
  def crash(kind, reason, stacktrace, message, p) do
    why = if kind == :error, do: {reason, stacktrace}, else: reason
    terminate(p, why)
    report(why, message, p)
    :erlang.raise(kind, reason, stacktrace)
  end

  defp terminate(%{module: module, state: state}, reason) do
    if function_exported?(module, :terminate, 2), do: module.terminate(reason, state)
  end

  defp report(reason, _message, _p) when reason in [:normal, :shutdown], do: :ok
  defp report({:shutdown, _why}, _message, _p), do: :ok

  # The report of OTP's own servers, which loggers know how to write.
  defp report(reason, message, p) do
    about = %{
      label: {:gen_server, :terminate},
      name: p.name,
      last_message: message,
      state: p.state,
      log: [],
      reason: reason,
      client_info: :undefined
    }

    :logger.error(about, %{
      domain: [:otp],
      report_cb: &:gen_server.format_log/2,
      error_logger: %{tag: :error, report_cb: &:gen_server.format_log/1}
    })
  end
end
