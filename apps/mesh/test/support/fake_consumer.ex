defmodule Mesh.FakeConsumer do
  @moduledoc """
  A `Mesh.Consumer` for tests. Its messages are `{:beat, robot, boot, sequence}`, `{:letter, robot, text}` and
  `{:passed_on, robot, message}`. It sends what it receives to the process that is registered under this module's
  name, if there is one.
  """
  @behaviour Mesh.Consumer

  @impl Mesh.Consumer
  def services, do: %{rows: {__MODULE__, :serve, [:rows]}, stop: {__MODULE__, :serve, [:stop]}}

  @impl Mesh.Consumer
  def late, do: [:stop]

  @doc "Takes a service's term."
  def serve(service, node, term), do: tell({service, node, term})

  @impl Mesh.Consumer
  def read({:beat, robot, boot, sequence} = message),
    do: {:ok, message, %{robots: [robot], beat: {boot, sequence}}}

  def read({:letter, robot, _text} = message),
    do: {:ok, message, %{robots: [robot], beat: nil}}

  def read({:passed_on, robot, inner} = message) do
    with {:ok, ^inner, %{robots: robots}} <- read(inner),
         do: {:ok, message, %{robots: [robot | robots], beat: nil}}
  end

  def read(_junk), do: :error

  @impl Mesh.Consumer
  def deliver(to, node, message), do: tell({:delivered, to, node, message})

  @impl Mesh.Consumer
  def command(:nobody, _request), do: :error
  def command(robot, request), do: tell({:command, robot, request})

  defp tell(message) do
    with pid when is_pid(pid) <- Process.whereis(__MODULE__), do: send(pid, message)
    :ok
  end
end
