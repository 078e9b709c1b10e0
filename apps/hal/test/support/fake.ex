defmodule Hal.Fake do
  @moduledoc """
  Drivers for tests, which tell the test process what they are asked to do, as
  `{device, what, pid of the device's process}`.

  Options: `:test` (pid), `:device` (what it calls itself), `:open` (a function of no arguments
  that gives `:ok`, `{:error, reason}` or raises; asked at each opening), `:ready` (such a function,
  asked whether it may be armed), `:told` (such a function, what a drive answers to a speed), `:reports`
  (such a function, asked ten times a second what a drive reports; by default `[:wheels, :sonar]`), `:words`
  (a function of a reason that explains it).

  A device process that runs one does as it is told by messages: `{:readings, list}`,
  `{:fail, reason}`, `:raise`.
  """

  @doc "Opens."
  def init(options) do
    tell(options, :init)

    case Keyword.get(options, :open, fn -> :ok end).() do
      :ok -> {:ok, options}
      {:error, reason} -> {:error, reason}
    end
  end

  @doc "Does what the message says."
  def handle_message({:readings, readings}, options), do: {:ok, readings, options}
  def handle_message({:fail, reason}, options), do: {:error, reason, options}
  def handle_message(:raise, options), do: raise("#{inspect(options[:device])} was told to")
  def handle_message(_other, options), do: {:ok, [], options}

  @doc "Closes."
  def terminate(options) do
    tell(options, :terminate)
    :ok
  end

  @doc "Tells the test."
  def tell(options, what), do: send(options[:test], {options[:device], what, self()})
end

defmodule Hal.FakeDrive do
  @moduledoc "See `Hal.Fake`. Tells `{:drive, twist}`."
  @behaviour Hal.Drive

  @period_ms 100

  @impl Hal.Drive
  def init(options) do
    with {:ok, options} <- Hal.Fake.init(options) do
      opening = make_ref()
      send(self(), {:report, opening})
      {:ok, Keyword.put(options, :opening, opening)}
    end
  end

  @impl Hal.Drive
  def drive(twist, options) do
    Hal.Fake.tell(options, {:drive, twist})

    case Keyword.get(options, :told, fn -> :ok end).() do
      :ok -> {:ok, options}
      {:error, reason} -> {:error, reason, options}
    end
  end

  @impl Hal.Drive
  def explain(reason, options), do: Keyword.get(options, :words, &inspect/1).(reason)

  @impl Hal.Drive
  def ready(options), do: Keyword.get(options, :ready, fn -> :ok end).()

  @impl Hal.Drive
  def handle_message({:report, opening}, options) do
    if options[:opening] == opening do
      Process.send_after(self(), {:report, opening}, @period_ms)
      reports = Keyword.get(options, :reports, fn -> [:wheels, :sonar] end).()
      {:ok, for(what <- reports, do: {:report, what}), options}
    else
      {:ok, [], options}
    end
  end

  def handle_message(message, options), do: Hal.Fake.handle_message(message, options)

  @impl Hal.Drive
  defdelegate terminate(options), to: Hal.Fake
end

defmodule Hal.FakePtz do
  @moduledoc "See `Hal.Fake`. Tells `{:look, pan, tilt}`."
  @behaviour Hal.Ptz

  @impl Hal.Ptz
  defdelegate init(options), to: Hal.Fake

  @impl Hal.Ptz
  def look(pan, tilt, options) do
    Hal.Fake.tell(options, {:look, pan, tilt})
    {:ok, options}
  end

  @impl Hal.Ptz
  defdelegate handle_message(message, options), to: Hal.Fake

  @impl Hal.Ptz
  defdelegate terminate(options), to: Hal.Fake
end

defmodule Hal.FakeCamera do
  @moduledoc "See `Hal.Fake`. Tells `:next`."
  @behaviour Hal.Camera

  @impl Hal.Camera
  defdelegate init(options), to: Hal.Fake

  @impl Hal.Camera
  def next(options) do
    Hal.Fake.tell(options, :next)
    {:ok, options}
  end

  @impl Hal.Camera
  defdelegate handle_message(message, options), to: Hal.Fake

  @impl Hal.Camera
  defdelegate terminate(options), to: Hal.Fake
end
