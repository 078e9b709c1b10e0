defmodule Sim.Device do
  @moduledoc """
  Turns what the server of a simulated world sends into the readings of wheels, pan-tilt units and lidars.
  """
  alias Sim.Lateness

  @doc "As `c:Hal.Drive.handle_message/2`; readings that are late are dropped."
  @spec handle_message(term(), state) :: {:ok, list(), state} | {:error, term(), state}
        when state: %{:line => {pid(), reference()}, :least => term(), optional(atom()) => term()}
  def handle_message({:world, server, {:readings, sent_ms, all}}, %{line: {server, _}} = s) do
    {late?, least} = Lateness.late?(s.least, sent_ms, Hal.Clock.now_ms())
    {:ok, if(late?, do: [], else: all), %{s | least: least}}
  end

  def handle_message({:world, server, {:error, reason}}, %{line: {server, _}} = s),
    do: {:error, reason, s}

  def handle_message({:DOWN, monitor, _, _, _}, %{line: {_, monitor}} = s),
    do: {:error, :no_world, s}

  def handle_message(_other, s), do: {:ok, [], s}
end
